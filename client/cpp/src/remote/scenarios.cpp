#include "connection/traceparent.h"
#include "marble/convert_scenarios.h"
#include "message/solve_events.h"
#include "remote/calls.h"
#include "remote/scenario_request.h"

namespace marble::client {

Expected<RemoteScenarios> solve_scenarios_remotely(const Connection& connection,
                                                   const ScenarioProblem& problem,
                                                   const ScenarioSampler* sampler,
                                                   const ScenarioSettings& settings,
                                                   const SolveControls& controls, const CallControls& call) {
  const auto request = make_request(problem, sampler, settings, call);
  if (!request) return unexpected(request.error());
  grpc::ClientContext context;
  if (auto ready = connection.prepare(context, call.traceparent, connection.deadline_of(call.deadline));
      !ready)
    return unexpected(ready.error());
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const auto reader = connection.solver().SolveScenarios(&context, *request);
  v1::SolveResponse result;
  const auto last = read_events(*reader, controls.progress, controls.activity, call, controls.stop,
                                [&](const v1::SolveStreamResponse& event) {
                                  if (event.has_stage() && settings.stage)
                                    settings.stage(sample_average_stage_of(event.stage()));
                                  if (event.has_result()) result = event.result();
                                });
  if (!last) return unexpected(last.error());
  auto answer = remote_scenarios(result);
  if (!answer) return answer;
  answer->progress_skipped = last->progress_skipped;
  answer->traceparent = returned_traceparent(context);
  return answer;
}

}  // namespace marble::client
