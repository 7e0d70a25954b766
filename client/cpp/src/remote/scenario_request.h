// Builds the request of a scenario solve and reads its result.
#pragma once

#include "marble/call_controls.h"
#include "marble/remote_scenarios.h"
#include "marble/v1/service.pb.h"

namespace marble::client {

/// Sends the scenarios of `problem` as numbers; or the sampler, if given, from which the server draws.
[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const ScenarioProblem& problem,
                                                            const ScenarioSampler* sampler,
                                                            const ScenarioSettings& settings,
                                                            const CallControls& call);

/// Errors: failed_precondition if the problem was solved alone.
[[nodiscard]] Expected<RemoteScenarios> remote_scenarios(const v1::SolveResponse& response);

}  // namespace marble::client
