// Computes one plan for many scenarios on a server.
#pragma once

#include "connection/connection.h"
#include "marble/call_controls.h"
#include "marble/remote_scenarios.h"
#include "marble/solver.h"

namespace marble::client {

/// If the sampler is null, the scenarios are those of the problem.
[[nodiscard]] Expected<RemoteScenarios> solve_scenarios_remotely(
    const Connection& connection, const ScenarioProblem& problem, const ScenarioSampler* sampler,
    const ScenarioSettings& settings, const SolveControls& controls, const CallControls& call);

}  // namespace marble::client
