#include "calls/solve_call.h"

#include "base/status.h"
#include "base/wire.h"
#include "service/admission.h"
#include "service/reply.h"

namespace marble::server {

grpc::ServerUnaryReactor* SolveCall::begin(const ServiceParts& parts, grpc::CallbackServerContext& context,
                                           const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const std::shared_ptr<SolveCall> call(new SolveCall(parts, response));
  call->self_ = call;
  Origin origin = origin_of(context);
  if (const auto admitted = call->admit(request, context, origin); !admitted) {
    call->Finish(refused(parts, origin, admitted.error()));
  }
  return call.get();
}

Expected<void> SolveCall::admit(const grpc::ByteBuffer* request, const grpc::CallbackServerContext& context,
                                Origin& origin) {
  MARBLE_ASSIGN_OR_RETURN(const auto caller, caller_of(parts_, context, origin, Role::solve));
  MARBLE_RETURN_IF_ERROR(refuse_early(parts_, caller, *request, origin));
  auto message = std::make_shared<v1::SolveRequest>();
  MARBLE_RETURN_IF_ERROR(parse(request, message.get()));
  origin.request_id = message->request_id();
  const bool composite = message->has_coupled() || message->has_scenarios();
  MARBLE_ASSIGN_OR_RETURN(auto job, make_job(parts_, caller, JobKind::solve, std::move(message)));
  job->observer = self_;
  job_ = job;
  if (const auto place = composite ? parts_.scheduler.admit(job) : parts_.scheduler.admit_here(job); !place) {
    job_ = nullptr;
    return unexpected(place.error());
  }
  return {};
}

void SolveCall::OnCancel() {
  if (job_ != nullptr) parts_.scheduler.cancel(job_);
}

void SolveCall::OnDone() { const auto last = std::move(self_); }

void SolveCall::finished(Outcome outcome) {
  v1::SolveResponse message;
  const auto filled = fill_response(*job_->record, outcome, &message);
  if (filled) *response_ = serialize(message);
  Finish(filled ? grpc::Status::OK : to_status(filled.error(), outcome.retry_delay_s));
}

}  // namespace marble::server
