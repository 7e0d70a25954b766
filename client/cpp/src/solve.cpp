#include "solve.h"

#include "answer.h"
#include "request.h"
#include "status.h"
#include "traceparent.h"

namespace marble::client {
namespace {

void deliver(const v1::SolveStreamResponse& event, ProgressSink* progress, const CallControls& call) {
  if (event.has_accepted() && call.accepted) {
    const v1::Accepted& accepted = event.accepted();
    call.accepted(accepted.job_id(), accepted.queue_position(), accepted.estimated_wait_s());
  } else if (event.has_queued() && call.moved) {
    call.moved(event.queued().queue_position(), event.queued().estimated_wait_s());
  } else if (event.has_started() && call.started) {
    call.started(event.started().queue_s());
  } else if (event.has_progress() && progress != nullptr) {
    for (const v1::Progress& row : event.progress().rows()) progress->report(progress_of(row));
  }
}

Expected<RemoteSolution> unary(const Connection& connection, const v1::SolveRequest& request,
                               grpc::ClientContext& context, const std::stop_token& stop) {
  v1::SolveResponse response;
  const grpc::Status status = connection.solver().Solve(&context, request, &response);
  if (!status.ok()) return unexpected(to_error(status, stop));
  return remote_solution(response);
}

Expected<RemoteSolution> streamed(const Connection& connection, const v1::SolveStreamRequest& request,
                                  grpc::ClientContext& context, const SolveControls& controls,
                                  const CallControls& call) {
  const auto reader = connection.solver().SolveStream(&context, request);
  v1::SolveStreamResponse event;
  std::optional<RemoteSolution> answer;
  std::int64_t skipped = 0;
  while (reader->Read(&event)) {
    deliver(event, controls.progress, call);
    if (event.has_progress()) skipped = event.progress().skipped();
    if (event.has_result()) answer = remote_solution(event.result());
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return unexpected(to_error(status, controls.stop));
  if (!answer) return unexpected(Error{ErrorCode::internal, "", -1, "", "the stream ended without a result"});
  answer->progress_skipped = skipped;
  return std::move(*answer);
}

}  // namespace

Expected<RemoteSolution> solve(const Connection& connection, const ProblemView& problem,
                               const Options& options, const SolveControls& controls,
                               const CallControls& call) {
  const auto request = make_request(problem, options, controls, call);
  if (!request) return unexpected(request.error());
  grpc::ClientContext context;
  if (auto ready = connection.prepare(context, call.traceparent, call.deadline); !ready)
    return unexpected(ready.error());
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const bool stream = controls.progress != nullptr || call.accepted || call.moved || call.started;
  auto answer = stream ? streamed(connection, *request, context, controls, call)
                       : unary(connection, request->solve(), context, controls.stop);
  if (answer) answer->traceparent = returned_traceparent(context);
  return answer;
}

}  // namespace marble::client
