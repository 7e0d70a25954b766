#include "solve_stream.h"

#include <utility>

#include "admission.h"
#include "marble/convert.h"
#include "reply.h"
#include "status.h"
#include "wire.h"

namespace marble::server {
namespace {

Expected<void> check_progress(const v1::SolveStreamRequest& request) {
  const auto fault = [](const char* field, std::string value) {
    return unexpected(Error{ErrorCode::invalid_argument, field, -1, std::move(value), "must be >= 0"});
  };
  if (!(request.progress_interval_s() >= 0.0)) {
    return fault("progress_interval_s", std::to_string(request.progress_interval_s()));
  }
  if (request.iterate_every() < 0) return fault("iterate_every", std::to_string(request.iterate_every()));
  return {};
}

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* SolveStreamCall::begin(const ServiceParts& parts,
                                                                   const grpc::CallbackServerContext& context,
                                                                   const grpc::ByteBuffer* request) {
  const std::shared_ptr<SolveStreamCall> call(new SolveStreamCall(parts));
  call->self_ = call;
  v1::SolveStreamRequest message;
  auto admitted = parse(request, &message);
  const std::string request_id = message.solve().request_id();
  if (admitted) admitted = call->admit(message, context);
  if (!admitted) {
    parts.scheduler.count_refused();
    log_refusal(parts.log, context.peer(), request_id, admitted.error());
    call->Finish(to_status(admitted.error(), parts.scheduler.retry_delay_s()));
  } else {
    call->go_on();
  }
  return call.get();
}

Expected<void> SolveStreamCall::admit(v1::SolveStreamRequest& request,
                                      const grpc::CallbackServerContext& context) {
  if (auto valid = check_progress(request); !valid) return valid;
  progress_interval_s_ = request.progress_interval_s();
  iterate_every_ = request.iterate_every();
  (void)request.mutable_solve();  // an absent one is an empty one, and refused as such
  auto job = make_job(std::shared_ptr<const v1::SolveRequest>(request.release_solve()), context);
  if (!job) {
    Error error = job.error();
    error.field = "solve." + error.field;
    return unexpected(std::move(error));
  }
  (*job)->observer = self_;
  job_ = *job;
  // A worker may take the job, and even finish it, before its place is known: nothing goes out before
  // "accepted".
  {
    const MutexLock lock(mutex_);
    writing_ = true;
  }
  const auto place = scheduler_.admit(*job);
  if (!place) {
    job_ = nullptr;
    return unexpected(place.error());
  }
  const MutexLock lock(mutex_);
  writing_ = false;
  queue_position_ = *place;
  return {};
}

void SolveStreamCall::started(double queue_s) {
  {
    const MutexLock lock(mutex_);
    queue_s_ = queue_s;
  }
  go_on();
}

void SolveStreamCall::report(const Progress& progress) {
  if (last_progress_s_ >= 0.0 && progress.elapsed_s - last_progress_s_ < progress_interval_s_) return;
  last_progress_s_ = progress.elapsed_s;
  slot_.put(progress, iterate_every_ > 0 && progress.iteration % iterate_every_ == 0);
  go_on();
}

void SolveStreamCall::finished(Outcome outcome) {
  {
    const MutexLock lock(mutex_);
    outcome_ = std::move(outcome);
    over_ = true;
  }
  go_on();
}

void SolveStreamCall::OnWriteDone(bool ok) {
  {
    const MutexLock lock(mutex_);
    writing_ = false;
    if (!ok) broken_ = true;
  }
  go_on();
}

void SolveStreamCall::OnCancel() {
  if (job_ != nullptr) scheduler_.cancel(job_);
}

void SolveStreamCall::OnDone() { const auto last = std::move(self_); }

bool SolveStreamCall::next_event(v1::SolveStreamResponse* event) {
  if (broken_) return false;
  if (queue_position_) {
    event->mutable_accepted()->set_job_id(job_->id);
    event->mutable_accepted()->set_queue_position(*std::exchange(queue_position_, std::nullopt));
    return true;
  }
  if (queue_s_) {
    event->mutable_started()->set_queue_s(*std::exchange(queue_s_, std::nullopt));
    return true;
  }
  if (const ProgressSlot::Rows taken = slot_.take(); !taken.rows.empty()) {
    v1::ProgressRows* progress = event->mutable_progress();
    for (const Progress& row : taken.rows) to_message(row, progress->add_rows());
    progress->mutable_rows()->rbegin()->mutable_z()->Assign(taken.newest_z.begin(), taken.newest_z.end());
    progress->set_skipped(taken.skipped);
    return true;
  }
  if (outcome_) {
    status_ = fill_response(*job_, *std::exchange(outcome_, std::nullopt), event->mutable_result());
    return status_.ok();
  }
  return false;
}

// gRPC may react within StartWrite or Finish, on this very thread: no lock is held there.
void SolveStreamCall::go_on() {
  v1::SolveStreamResponse event;
  grpc::Status status;
  bool write = false;
  {
    const MutexLock lock(mutex_);
    if (writing_ || finishing_) return;
    write = next_event(&event);
    if (!write && !over_) return;
    writing_ = write;
    finishing_ = !write;
    status = status_;
  }
  if (write) {
    bytes_ = serialize(event);
    StartWrite(&bytes_);
  } else {
    Finish(status);
  }
}

}  // namespace marble::server
