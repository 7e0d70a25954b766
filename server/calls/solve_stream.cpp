#include "calls/solve_stream.h"

#include <utility>

#include "base/status.h"
#include "base/wire.h"
#include "marble/convert.h"
#include "marble/convert_scenarios.h"
#include "service/admission.h"
#include "service/reply.h"

namespace marble::server {
grpc::ServerWriteReactor<grpc::ByteBuffer>* SolveStreamCall::begin(const ServiceParts& parts,
                                                                   grpc::CallbackServerContext& context,
                                                                   const grpc::ByteBuffer* request,
                                                                   Made made) {
  const std::shared_ptr<SolveStreamCall> call(new SolveStreamCall(parts));
  call->self_ = call;
  Origin origin = origin_of(context);
  if (const auto admitted = call->admit(request, context, origin, made); !admitted) {
    call->end_at_once(refused(parts, origin, admitted.error()));
  } else {
    parts.timer.add(call);
    call->go_on();
  }
  return call.get();
}

Expected<void> SolveStreamCall::admit(const grpc::ByteBuffer* bytes,
                                      const grpc::CallbackServerContext& context, Origin& origin, Made made) {
  MARBLE_ASSIGN_OR_RETURN(const auto caller, caller_of(parts_, context, origin, Role::solve));
  MARBLE_RETURN_IF_ERROR(
      refuse_early(parts_, caller, *bytes, origin, v1::SolveStreamRequest::kSolveFieldNumber));
  v1::SolveStreamRequest request;
  MARBLE_RETURN_IF_ERROR(parse(bytes, &request));
  origin.request_id = request.solve().request_id();
  MARBLE_RETURN_IF_ERROR(check_progress(request.progress_interval_s(), request.iterate_every()));
  progress_interval_s_ = request.progress_interval_s();
  iterate_every_ = request.iterate_every();
  (void)request.mutable_solve();  // a missing problem counts as an empty one, which is refused
  if (made.has != nullptr && !(request.solve().*made.has)())
    return unexpected(invalid(std::string("solve.") + made.of, "must be there"));
  auto job = make_job(parts_, caller, JobKind::solve,
                      std::shared_ptr<const v1::SolveRequest>(request.release_solve()));
  if (!job) return unexpected(inside("solve", job.error()));
  (*job)->observer = self_;
  job_ = *job;
  const auto place = parts_.scheduler.admit(*job);
  if (!place) {
    job_ = nullptr;
    return unexpected(place.error());
  }
  const MutexLock lock(mutex_);
  admitted_ = true;
  place_ = *place;
  return {};
}

void SolveStreamCall::moved(const QueuePlace& place) {
  {
    const MutexLock lock(mutex_);
    if (started_ || !accepted_ || place.position == reported_place_.position) return;
    place_ = place;
  }
  go_on();
}

void SolveStreamCall::started(double queue_s) {
  {
    const MutexLock lock(mutex_);
    queue_s_ = queue_s;
    started_ = true;
    slot_.started();
    if (accepted_) place_.reset();
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

void SolveStreamCall::gone() {
  if (job_ != nullptr) parts_.scheduler.cancel(job_);
}

void SolveStreamCall::on_timer(Clock::time_point /*now*/) { go_on(); }

// A worker may take the job, and even finish it, before its place is known: nothing is sent before
// "accepted".
bool SolveStreamCall::next_event(v1::SolveStreamResponse* event) {
  if (!admitted_) return false;
  if (place_) {
    reported_place_ = *std::exchange(place_, std::nullopt);
    if (accepted_) {
      event->mutable_queued()->set_queue_position(reported_place_.position);
      event->mutable_queued()->set_estimated_wait_s(reported_place_.estimated_wait_s);
    } else {
      event->mutable_accepted()->set_job_id(job_->record->id());
      event->mutable_accepted()->set_queue_position(reported_place_.position);
      event->mutable_accepted()->set_estimated_wait_s(reported_place_.estimated_wait_s);
      accepted_ = true;
    }
    return true;
  }
  if (queue_s_) {
    event->mutable_started()->set_queue_s(*std::exchange(queue_s_, std::nullopt));
    return true;
  }
  if (stages_.empty()) {
    const auto stages = job_->record->stages_from(reported_stages_);
    stages_.assign(stages.begin(), stages.end());
    reported_stages_ += stages.size();
  }
  if (!stages_.empty()) {
    to_message(stages_.front(), event->mutable_stage());
    stages_.pop_front();
    return true;
  }
  const bool quiet = !over_ && slot_.is_quiet();
  if (const auto taken = over_ || quiet || slot_.due() ? slot_.take() : ProgressSlot::Rows{};
      quiet || !taken.rows.empty()) {
    parts_.metrics.progress_sent(taken.rows.size(), taken.newly_skipped);
    fill_rows(taken, *job_->record, event->mutable_progress());
    return true;
  }
  if (outcome_) {
    const Outcome outcome = *std::exchange(outcome_, std::nullopt);
    const auto filled = fill_response(*job_->record, outcome, event->mutable_result());
    if (!filled) status_ = to_status(filled.error(), outcome.retry_delay_s);
    return filled.has_value();
  }
  return false;
}

std::optional<grpc::Status> SolveStreamCall::ending() {
  if (!admitted_ || !over_) return std::nullopt;
  const bool unreported = outcome_ && !outcome_->solution;  // the client no longer reads
  return unreported ? to_status(outcome_->solution.error(), outcome_->retry_delay_s) : status_;
}

}  // namespace marble::server
