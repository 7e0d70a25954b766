// One plan for many worlds, on a server.
#pragma once

#include "connection/connection.h"
#include "marble/call_controls.h"
#include "marble/remote_scenarios.h"
#include "marble/solver.h"

namespace marble::client {

/// The sampler may be null: the worlds are the problem's then.
[[nodiscard]] Expected<RemoteScenarios> solve_scenarios_there(
    const Connection& connection, const ScenarioProblem& problem, const ScenarioSampler* sampler,
    const ScenarioSettings& settings, const SolveControls& controls, const CallControls& call);

}  // namespace marble::client
