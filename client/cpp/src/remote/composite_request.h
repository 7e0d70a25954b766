// Builds the requests of coupled and scenario solves and reads their results.
#pragma once

#include <span>

#include "marble/call_controls.h"
#include "marble/coupled.h"
#include "marble/remote_scenarios.h"
#include "marble/v1/service.pb.h"

namespace marble::client {

/// Of the controls only the start is used; error if it has more than coupling_multipliers.
[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const CoupledView& view,
                                                            const CoupledOptions& options,
                                                            const CoupledControls& controls,
                                                            const CallControls& call);

[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const Problem& problem,
                                                            std::span<const Index> stage_of_variable,
                                                            const SegmentsOptions& options,
                                                            const CallControls& call);

/// Errors: failed_precondition if the problem was solved alone; "blocks" if its sizes do not match the
/// result.
[[nodiscard]] Expected<RemoteCoupledSolution> remote_coupled(const v1::SolveResponse& response,
                                                             const CoupledView& view);

/// Errors: failed_precondition if the problem was solved alone.
[[nodiscard]] Expected<RemoteSegmentsSolution> remote_segments(const v1::SolveResponse& response);

// Builds the request of a scenario solve and reads its result.

/// Sends the scenarios of `problem` as numbers; or the sampler, if given, from which the server draws.
[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const ScenarioProblem& problem,
                                                            const ScenarioSampler* sampler,
                                                            const ScenarioSettings& settings,
                                                            const CallControls& call);

/// Errors: failed_precondition if the problem was solved alone.
[[nodiscard]] Expected<RemoteScenarios> remote_scenarios(const v1::SolveResponse& response);

}  // namespace marble::client
