#include "calls/result_call.h"

#include "base/fault_point.h"
#include "base/status.h"
#include "base/wire.h"
#include "marble/v1/service.pb.h"
#include "service/admission.h"
#include "service/job_access.h"
#include "store/submissions.h"
#include "submissions/array.h"

namespace marble::server {

grpc::ServerUnaryReactor* ResultCall::begin(const ServiceParts& parts, grpc::CallbackServerContext& context,
                                            const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const std::shared_ptr<ResultCall> call(new ResultCall(parts, response));
  call->self_ = call;
  if (const auto waits = call->wait(context, request); !waits) call->finish(to_status(waits.error()));
  return call.get();
}

Expected<void> ResultCall::wait(grpc::CallbackServerContext& context, const grpc::ByteBuffer* request) {
  Origin origin = origin_of(context);
  MARBLE_ASSIGN_OR_RETURN(const auto caller, identify(parts_, context, origin));
  v1::JobResultRequest message;
  MARBLE_RETURN_IF_ERROR(parse(request, &message));
  id_ = message.job_id();
  const std::string owner = parts_.results.owner(id_);
  if (owner.empty() || !may_end(caller, owner)) {
    return unexpected(failure(ErrorCode::not_found, "job_id", id_,
                              "is no submitted job, or its answer is not kept any more"));
  }
  if (parts_.submissions->is_array(id_)) return unexpected(no_single_answer(id_).answer.error());
  const auto record = parts_.board.find(id_);
  // A job that has just finished has its result in a moment.
  const bool over = record == nullptr || record->is_finished() || parts_.results.get(id_) != nullptr;
  if (!message.wait() && !over) {
    return unexpected(
        failure(ErrorCode::failed_precondition, "job_id", id_, "has not finished; wait, or come back"));
  }
  parts_.results.wait(id_, this, [call = self_](const ResultStore::Shared& result) { call->answer(result); });
  parts_.timer.add(self_);
  return {};
}

void ResultCall::answer(const ResultStore::Shared& result) {
  if (result == nullptr)
    return finish(
        to_status(failure(ErrorCode::not_found, "job_id", id_, "was deleted, and its answer with it")));
  if (!result->answer) return finish(to_status(result->answer.error(), result->retry_delay_s));
  if (finished_.exchange(true)) return;
  *response_ = *result->answer;
  Finish(grpc::Status::OK);
  fault_point("within_answer");
}

void ResultCall::finish(const grpc::Status& status) {
  if (!finished_.exchange(true)) Finish(status);
}

void ResultCall::OnCancel() {
  parts_.results.stop_waiting(id_, this);
  finish(to_status(failure(ErrorCode::cancelled, "the client gave up")));
}

void ResultCall::OnDone() { const auto last = std::move(self_); }

// Sends results of the jobs that a drain still finishes; after that there is nothing to wait for.
void ResultCall::on_timer(Clock::time_point /*now*/) {
  if (!parts_.scheduler.is_drained() || finished_) return;
  if (!parts_.submissions->is_settled()) return;
  parts_.results.stop_waiting(id_, this);
  finish(end_of_stream(parts_, draining()));
}

}  // namespace marble::server
