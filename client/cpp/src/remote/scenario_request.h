// What a scenario solve sends, and its answer.
#pragma once

#include "marble/call_controls.h"
#include "marble/remote_scenarios.h"
#include "marble/v1/service.pb.h"

namespace marble::client {

/// The worlds of `problem` as numbers; or the sampler, if there is one, which is drawn there.
[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const ScenarioProblem& problem,
                                                            const ScenarioSampler* sampler,
                                                            const ScenarioSettings& settings,
                                                            const CallControls& call);

/// Errors: failed_precondition where the problem was solved alone.
[[nodiscard]] Expected<RemoteScenarios> remote_scenarios(const v1::SolveResponse& response);

}  // namespace marble::client
