#include "message/solve_events.h"

#include "message/answer.h"

namespace marble::client {

void SolveEvents::take(const v1::SolveStreamResponse& event) {
  if (event.has_accepted() && call_.accepted) {
    const v1::Accepted& accepted = event.accepted();
    call_.accepted(accepted.job_id(), accepted.queue_position(), accepted.estimated_wait_s());
  } else if (event.has_queued() && call_.moved) {
    call_.moved(event.queued().queue_position(), event.queued().estimated_wait_s());
  } else if (event.has_started() && call_.started) {
    call_.started(event.started().queue_s());
  } else if (event.has_progress()) {
    skipped_ = event.progress().skipped();
    if (activity_ != nullptr && event.progress().has_activity())
      activity_->set(activity_of(event.progress().activity()));
    if (progress_ == nullptr) return;
    for (const v1::Progress& row : event.progress().rows()) progress_->report(progress_of(row));
  } else if (event.has_result()) {
    answer_ = remote_solution(event.result());
  }
}

Expected<RemoteSolution> SolveEvents::answer() {
  if (!answer_) return unexpected(failure(ErrorCode::internal, "the stream ended without a result"));
  answer_->progress_skipped = skipped_;
  return std::move(*answer_);
}

}  // namespace marble::client
