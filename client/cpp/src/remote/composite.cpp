#include "connection/traceparent.h"
#include "marble/composite/coupled_progress.h"
#include "marble/convert_coupled.h"
#include "marble/convert_scenarios.h"
#include "message/solve_events.h"
#include "remote/calls.h"
#include "remote/composite_request.h"

namespace marble::client {
namespace {

class ReportedIterations final : public ProgressSink {
 public:
  explicit ReportedIterations(const CoupledControls& controls) : controls_(controls) {}
  void report(const Progress& row) override {
    if (controls_.progress) controls_.progress(coupled_iteration_of(row));
  }

 private:
  const CoupledControls& controls_;
};

// Sends the request; `read` converts the last event.
template <class Read>
auto solve_remotely(const Connection& connection, const v1::SolveStreamRequest& request,
                    const CoupledControls& controls, const CallControls& call, const Read& read)
    -> decltype(read(v1::SolveResponse())) {
  grpc::ClientContext context;
  MARBLE_RETURN_IF_ERROR(connection.prepare(context, call));
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const auto reader = connection.solver().SolveCoupled(&context, request);
  ReportedIterations reported(controls);
  v1::SolveResponse result;
  const auto last = read_events(*reader, &reported, controls.activity, call, controls.stop,
                                [&](const v1::SolveStreamResponse& event) {
                                  if (event.has_result()) result = event.result();
                                });
  if (!last) return unexpected(of_field(coupled_core_field(last.error().field), last.error()));
  MARBLE_ASSIGN_OR_RETURN(auto answer, read(result));
  answer.progress_skipped = last->progress_skipped;
  answer.traceparent = returned_traceparent(context);
  return answer;
}

}  // namespace

Expected<RemoteCoupledSolution> solve_coupled_remotely(const Connection& connection, const CoupledView& view,
                                                       const CoupledOptions& options,
                                                       const CoupledControls& controls,
                                                       const CallControls& call) {
  MARBLE_ASSIGN_OR_RETURN(const auto request, make_request(view, options, controls, call));
  return solve_remotely(connection, request, controls, call,
                        [&](const v1::SolveResponse& response) { return remote_coupled(response, view); });
}

Expected<RemoteSegmentsSolution> solve_in_segments_remotely(
    const Connection& connection, const Problem& problem, std::span<const Index> stage_of_variable,
    const SegmentsOptions& options, const CoupledControls& controls, const CallControls& call) {
  MARBLE_ASSIGN_OR_RETURN(const auto request, make_request(problem, stage_of_variable, options, call));
  return solve_remotely(connection, request, controls, call, remote_segments);
}

Expected<RemoteScenarios> solve_scenarios_remotely(const Connection& connection,
                                                   const ScenarioProblem& problem,
                                                   const ScenarioSampler* sampler,
                                                   const ScenarioSettings& settings,
                                                   const SolveControls& controls, const CallControls& call) {
  MARBLE_ASSIGN_OR_RETURN(const auto request, make_request(problem, sampler, settings, call));
  grpc::ClientContext context;
  MARBLE_RETURN_IF_ERROR(connection.prepare(context, call));
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const auto reader = connection.solver().SolveScenarios(&context, request);
  v1::SolveResponse result;
  const auto last = read_events(*reader, controls.progress, controls.activity, call, controls.stop,
                                [&](const v1::SolveStreamResponse& event) {
                                  if (event.has_stage() && settings.stage)
                                    settings.stage(sample_average_stage_of(event.stage()));
                                  if (event.has_result()) result = event.result();
                                });
  if (!last) return unexpected(last.error());
  MARBLE_ASSIGN_OR_RETURN(auto answer, remote_scenarios(result));
  answer.progress_skipped = last->progress_skipped;
  answer.traceparent = returned_traceparent(context);
  return answer;
}

}  // namespace marble::client
