#include "solve_stream.h"

#include "admission.h"
#include "marble/convert.h"
#include "status.h"

namespace marble::server {

SolveStreamCall::SolveStreamCall(Scheduler& scheduler, const Log& log,
                                 const grpc::CallbackServerContext& context,
                                 const v1::SolveStreamRequest& request)
    : scheduler_(scheduler),
      progress_interval_s_(request.progress_interval_s()),
      iterate_every_(request.iterate_every()) {
  const auto refuse = [&](const Error& error, double retry_delay_s) {
    log_refusal(log, context.peer(), request.solve(), error);
    Finish(to_status(error, retry_delay_s));
  };
  auto job = make_job(request.solve(), context);
  if (job && !(progress_interval_s_ >= 0.0)) {
    job = unexpected(Error{ErrorCode::invalid_argument, "progress_interval_s", -1,
                           std::to_string(progress_interval_s_), "must be >= 0"});
  } else if (job && iterate_every_ < 0) {
    job = unexpected(Error{ErrorCode::invalid_argument, "iterate_every", -1, std::to_string(iterate_every_),
                           "must be >= 0"});
  } else if (!job) {
    Error error = job.error();
    error.field = "solve." + error.field;
    job = unexpected(std::move(error));
  }
  if (!job) {
    scheduler_.count_refused();
    refuse(job.error(), 0.0);
    return;
  }
  job_ = *job;
  job_->observer = this;
  // A worker may take the job, and even finish it, before admit() returns: "accepted" must go out before all
  // that.
  {
    absl::MutexLock lock(&mutex_);
    writing_ = true;
  }
  const auto position = scheduler_.admit(job_);
  if (!position) {
    refuse(position.error(), scheduler_.retry_delay_s());
    return;
  }
  {
    absl::MutexLock lock(&mutex_);
    writing_ = false;
    accepted_due_ = true;
    queue_position_ = *position;
  }
  go_on();
}

void SolveStreamCall::started(double queue_s) {
  {
    absl::MutexLock lock(&mutex_);
    started_due_ = true;
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
    absl::MutexLock lock(&mutex_);
    status_ = fill_response(*job_, std::move(outcome), scheduler_, &result_);
    result_due_ = status_.ok();
    over_ = true;
  }
  go_on();
}

void SolveStreamCall::OnWriteDone(bool ok) {
  {
    absl::MutexLock lock(&mutex_);
    writing_ = false;
    if (!ok) broken_ = true;
  }
  go_on();
}

void SolveStreamCall::OnCancel() {
  if (job_ != nullptr) scheduler_.cancel(job_);
}

SolveStreamCall::Next SolveStreamCall::choose_next() {
  if (writing_ || finishing_) return Next::nothing;
  if (!broken_) {
    message_.Clear();
    if (accepted_due_) {
      accepted_due_ = false;
      message_.mutable_accepted()->set_job_id(job_->id);
      message_.mutable_accepted()->set_queue_position(queue_position_);
      return Next::write;
    }
    if (started_due_) {
      started_due_ = false;
      message_.mutable_started()->set_queue_s(queue_s_);
      return Next::write;
    }
    if (const ProgressSlot::Rows taken = slot_.take(); !taken.rows.empty()) {
      v1::ProgressRows* progress = message_.mutable_progress();
      for (const Progress& row : taken.rows) to_message(row, progress->add_rows());
      progress->mutable_rows()->rbegin()->mutable_z()->Assign(taken.newest_z.begin(), taken.newest_z.end());
      progress->set_skipped(taken.skipped);
      return Next::write;
    }
    if (result_due_) {
      result_due_ = false;
      message_.mutable_result()->Swap(&result_);
      return Next::write;
    }
  }
  return over_ ? Next::finish : Next::nothing;
}

// gRPC may react within StartWrite or Finish, on this very thread: no lock is held there.
void SolveStreamCall::go_on() {
  grpc::Status status;
  const v1::SolveStreamResponse* message = nullptr;
  {
    absl::MutexLock lock(&mutex_);
    switch (choose_next()) {
      case Next::nothing:
        return;
      case Next::write:
        writing_ = true;
        message = &message_;
        break;
      case Next::finish:
        finishing_ = true;
        status = status_;
        break;
    }
  }
  if (message != nullptr) {
    StartWrite(message);
  } else {
    Finish(status);
  }
}

}  // namespace marble::server
