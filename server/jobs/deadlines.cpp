// Which jobs cannot end by their deadlines, by the estimates from earlier jobs.
#include <algorithm>

#include "jobs/scheduler.h"

namespace marble::server {
namespace {

// Part of the time until a deadline for the result to arrive: a tenth, but no more than a busy machine needs.
constexpr double kShareForAnswer = 0.1;
constexpr double kMostForAnswerS = 0.025;

double for_answer_s(double left_s) { return std::min(kMostForAnswerS, kShareForAnswer * left_s); }

Error cannot_be_in_time(double left_s, double wait_s, double likely_s) {
  return failure(ErrorCode::resource_exhausted, "deadline", std::to_string(left_s) + " s",
                 "leaves no time for a wait of about " + std::to_string(wait_s) + " s and a solve of about " +
                     std::to_string(likely_s) + " s");
}

// Updates of sessions follow a contract of their own: they are tried unless their deadline has passed.
bool may_be_refused(const Ticket& ticket) {
  return !ticket.reserved && ticket.deadline != Clock::time_point::max();
}

}  // namespace

// Fills in the ticket.
void Scheduler::estimate_run(Job& job, const RunEstimates::Key& key) {
  job.ticket.expected_run_s = estimates_.mean_s(key);
  if (job.ticket.expected_run_s == 0.0)
    job.ticket.expected_run_s = mean_run_s_[static_cast<std::size_t>(job.ticket.priority)];
  if (!may_be_refused(job.ticket)) return;
  // A job that begins should end in time, but one with little time from the start is not refused for it.
  const double half_s = std::max(0.0, 0.5 * seconds(job.ticket.deadline - Clock::now()));
  job.ticket.least_run = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
      std::min(half_s, estimates_.longest_s(key) + for_answer_s(2.0 * half_s))));
}

// Of jobs that even an idle server could not finish in time, one is tried now and then: the estimate may be
// outdated. So is any for which a worker is idle.
Scheduler::Chance Scheduler::chance_of(const Job& job, const RunEstimates::Key& key, double wait_s) const {
  if (!may_be_refused(job.ticket)) return {};
  const Clock::time_point now = Clock::now();
  const double left_s = seconds(job.ticket.deadline - now);
  const double left_for_it_s = left_s - for_answer_s(left_s);
  const double likely_s = estimates_.likely_s(key);
  if (left_s <= 0.0 || wait_s + likely_s <= left_for_it_s) return {};
  if (wait_s <= 0.0 || (wait_s <= left_for_it_s && estimates_.is_old(key, now))) return {.is_likely = false};
  return {.is_likely = false, .refusal = cannot_be_in_time(left_s, wait_s, likely_s)};
}

// Removes a job again that by the estimates cannot end in time, or lets it be tried.
Expected<void> Scheduler::check_deadline(const std::shared_ptr<Job>& job, const RunEstimates::Key& key,
                                         double wait_s) {
  const Chance chance = chance_of(*job, key, wait_s);
  if (chance.is_likely) return {};
  queue_.remove(job.get());
  if (chance.refusal) return unexpected(*chance.refusal);
  if (wait_s > 0.0) estimates_.tries(key, Clock::now());
  job->ticket.least_run = {};
  static_cast<void>(queue_.push(job, job->ticket, job->quota));  // back to the place that it just left
  return {};
}

Expected<void> Scheduler::may_enter(const std::shared_ptr<Job>& job) {
  const MutexLock lock(mutex_);
  if (closed_) return unexpected(draining());
  const RunEstimates::Key key = key_of(job->ticket);
  estimate_run(*job, key);
  if (const auto why = queue_.push(job, job->ticket, job->quota); why != QueueRefusal::none)
    return unexpected(refusal_of(why, limits_, job->ticket, job->quota));
  const Chance chance = chance_of(*job, key, place_of(*job, busy_s()).estimated_wait_s);
  queue_.remove(job.get());
  return chance.refusal ? Expected<void>(unexpected(*chance.refusal)) : Expected<void>();
}

}  // namespace marble::server
