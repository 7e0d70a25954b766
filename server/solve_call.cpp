#include "solve_call.h"

#include "admission.h"
#include "reply.h"
#include "status.h"
#include "wire.h"

namespace marble::server {

grpc::ServerUnaryReactor* SolveCall::begin(const ServiceParts& parts,
                                           const grpc::CallbackServerContext& context,
                                           const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const std::shared_ptr<SolveCall> call(new SolveCall(parts, response));
  call->self_ = call;
  const auto message = std::make_shared<v1::SolveRequest>();
  auto admitted = parse(request, message.get());
  if (admitted) admitted = call->admit(message, context);
  if (!admitted) {
    parts.scheduler.count_refused();
    log_refusal(parts.log, context.peer(), message->request_id(), admitted.error());
    call->Finish(to_status(admitted.error(), parts.scheduler.retry_delay_s()));
  }
  return call.get();
}

Expected<void> SolveCall::admit(std::shared_ptr<const v1::SolveRequest> request,
                                const grpc::CallbackServerContext& context) {
  auto job = make_job(std::move(request), context);
  if (!job) return unexpected(job.error());
  (*job)->observer = self_;
  job_ = *job;
  if (const auto place = scheduler_.admit(*job); !place) {
    job_ = nullptr;
    return unexpected(place.error());
  }
  return {};
}

void SolveCall::OnCancel() {
  if (job_ != nullptr) scheduler_.cancel(job_);
}

void SolveCall::OnDone() { const auto last = std::move(self_); }

void SolveCall::finished(Outcome outcome) {
  v1::SolveResponse message;
  const grpc::Status status = fill_response(*job_, outcome, &message);
  if (status.ok()) *response_ = serialize(message);
  Finish(status);
}

}  // namespace marble::server
