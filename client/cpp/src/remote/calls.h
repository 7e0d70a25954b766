// The calls of a remote Client.
#pragma once

#include <span>
#include <stop_token>

#include "connection/connection.h"
#include "marble/batch.h"
#include "marble/call_controls.h"
#include "marble/coupled.h"
#include "marble/remote_scenarios.h"
#include "marble/server_info.h"
#include "marble/solver.h"

namespace marble::client {

/// Makes a unary call, or a stream if events are requested.
[[nodiscard]] Expected<RemoteSolution> solve_remotely(const Connection& connection,
                                                      const ProblemView& problem, const Options& options,
                                                      const SolveControls& controls,
                                                      const CallControls& call);

[[nodiscard]] Expected<void> solve_batch_remotely(const Connection& connection, const BatchSource& source,
                                                  const BatchSink& sink, const BatchControls& controls);

/// If the sampler is null, the scenarios are those of the problem.
[[nodiscard]] Expected<RemoteScenarios> solve_scenarios_remotely(
    const Connection& connection, const ScenarioProblem& problem, const ScenarioSampler* sampler,
    const ScenarioSettings& settings, const SolveControls& controls, const CallControls& call);

[[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled_remotely(const Connection& connection,
                                                                     const CoupledView& view,
                                                                     const CoupledOptions& options,
                                                                     const CoupledControls& controls,
                                                                     const CallControls& call);

[[nodiscard]] Expected<RemoteSegmentsSolution> solve_in_segments_remotely(
    const Connection& connection, const Problem& problem, std::span<const Index> stage_of_variable,
    const SegmentsOptions& options, const CoupledControls& controls, const CallControls& call);

[[nodiscard]] Expected<ServerInfo> server_info(const Connection& connection, const std::stop_token& stop);

}  // namespace marble::client
