#include "connection/traceparent.h"
#include "message/answer.h"
#include "message/request.h"
#include "message/solve_events.h"
#include "message/status.h"
#include "remote/calls.h"

namespace marble::client {
namespace {

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
  return read_events(*reader, controls.progress, controls.activity, call, controls.stop, [](const auto&) {});
}

}  // namespace

Expected<RemoteSolution> solve_remotely(const Connection& connection, const ProblemView& problem,
                                        const Options& options, const SolveControls& controls,
                                        const CallControls& call) {
  MARBLE_ASSIGN_OR_RETURN(const auto request, make_request(problem, options, controls, call));
  grpc::ClientContext context;
  MARBLE_RETURN_IF_ERROR(connection.prepare(context, call));
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  auto answer = wants_events(controls.progress, controls.activity, call)
                    ? streamed(connection, request, context, controls, call)
                    : unary(connection, request.solve(), context, controls.stop);
  if (answer) answer->traceparent = returned_traceparent(context);
  if (answer) connection.note_reached();
  return answer;
}

}  // namespace marble::client
