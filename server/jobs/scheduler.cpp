#include "jobs/scheduler.h"

#include <algorithm>
#include <exception>
#include <new>
#include <numeric>

#include "jobs/job_log.h"
#include "jobs/wait_estimate.h"

namespace marble::server {
namespace {

constexpr double kNewest = 0.1;                           // weight of the newest solve in the mean
constexpr auto kPlaces = std::chrono::milliseconds(250);  // between updates of all places in the queue
std::string full_queue(const QueueLimits& limits, Priority priority) {
  const int jobs = limits.jobs_for(priority);
  const int kept = limits.jobs - jobs;
  return "the queue is full: it holds at most " + std::to_string(jobs) + " jobs" +
         (kept > 0 ? ", and " + std::to_string(kept) + " more if they are realtime" : "");
}

}  // namespace

Error refusal_of(QueueRefusal why, const QueueLimits& limits, const Ticket& ticket, const Quota& quota) {
  constexpr ErrorCode kFull = ErrorCode::resource_exhausted;
  const std::string bytes = std::to_string(ticket.bytes) + " more";
  switch (why) {
    case QueueRefusal::jobs:
      return failure(kFull, "queue_jobs", full_queue(limits, ticket.priority));
    case QueueRefusal::bytes:
      return failure(kFull, "queue_bytes", bytes,
                     "requests may take at most " + std::to_string(limits.bytes) + " bytes together");
    case QueueRefusal::client_jobs:
      return failure(kFull, "client_queued",
                     "the client \"" + ticket.client + "\" may have at most " + std::to_string(quota.queued) +
                         " waiting jobs");
    case QueueRefusal::client_bytes:
      return failure(kFull, "client_bytes", bytes,
                     "requests of the client \"" + ticket.client + "\" may take at most " +
                         std::to_string(quota.bytes) + " bytes together");
    case QueueRefusal::none:
      break;
  }
  return {};
}

Error too_late(const Job& job, Clock::time_point now) {
  const double left_s = seconds(job.ticket.deadline - now);
  return failure(ErrorCode::deadline_exceeded,
                 left_s <= 0.0 ? "the deadline passed while the job waited"
                               : "the job was not begun: " + std::to_string(left_s) +
                                     " s were left, and jobs like it take " +
                                     std::to_string(seconds(job.ticket.least_run)) + " s");
}

EndedJob counted_of(const Job& job, const Outcome& outcome) {
  EndedJob ended{.client = job.ticket.client, .priority = job.ticket.priority, .queue_s = outcome.queue_s};
  if (!outcome.solution) return ended;
  const bool is_update = job.ticket.reserved && !job.is_setup;
  if (!is_update) ended.setup_s = outcome.solution->times.setup_s;
  if (solves(job)) ended.solution = &*outcome.solution;
  return ended;
}

Scheduler::Scheduler(const QueueLimits& limits, JobBoard& board, const Log& log, Metrics& metrics)
    : limits_(limits), board_(board), log_(log), metrics_(metrics), queue_(limits) {
  for (int i = 0; i < limits_.workers; ++i) workers_.emplace_back([this] { work(); });
}

Scheduler::~Scheduler() {
  drain(std::chrono::duration<double>(0.0));
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  work_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

Expected<QueuePlace> Scheduler::admit(const std::shared_ptr<Job>& job,
                                      const std::weak_ptr<RoomWaiter>& waiter) {
  Expected<QueuePlace> place = enqueue(job, waiter);
  if (place) work_.notify_one();  // without the lock, which the worker needs at once
  return place;
}

Expected<QueuePlace> Scheduler::enqueue(const std::shared_ptr<Job>& job,
                                        const std::weak_ptr<RoomWaiter>& waiter, bool* here) {
  const MutexLock lock(mutex_);
  if (closed_ && !(job->ticket.reserved && !hurried_)) {
    return unexpected(draining());
  }
  const RunEstimates::Key key = key_of(job->ticket);
  estimate_run(*job, key);
  if (const auto why = queue_.push(job, job->ticket, job->quota); why != QueueRefusal::none) {
    if (fits_alone(*job) && !waiter.expired()) room_waiters_.push_back(waiter);
    return unexpected(refusal_of(why, limits_, job->ticket, job->quota));
  }
  look_at_waiting();
  const QueuePlace place = place_of(*job, busy_s());
  MARBLE_RETURN_IF_ERROR(check_deadline(job, key, place.estimated_wait_s));
  if (!job->ticket.reserved) ++counters_.accepted;
  if (job->ticket.takes_place()) {
    board_.add(job->record);
    job->record->set_cancel([this, weak = std::weak_ptr<Job>(job)] {
      if (const std::shared_ptr<Job> strong = weak.lock()) cancel(strong);
    });
    job->record->set_place([this, weak = std::weak_ptr<Job>(job)] {
      const std::shared_ptr<Job> strong = weak.lock();
      return strong != nullptr ? this->place(*strong) : QueuePlace{};
    });
  }
  job->record->queued();
  if (job->observer->wants_place()) place_listeners_.push_back({job, job->observer});
  if (here != nullptr) *here = begin_here(job);
  return place;
}

std::unique_ptr<Scheduler::Held> Scheduler::hold(const std::string& client, std::int64_t bytes,
                                                 const Quota& quota) {
  const MutexLock lock(mutex_);
  if (!queue_.hold(client, bytes, quota)) return nullptr;
  return std::make_unique<Held>(*this, client, bytes);
}

void Scheduler::release(const std::string& client, std::int64_t bytes) {
  const MutexLock lock(mutex_);
  queue_.release(client, bytes);
}

Expected<std::unique_ptr<Scheduler::Place>> Scheduler::open_place(const std::string& client,
                                                                  Priority priority, const Quota& quota,
                                                                  bool always) {
  const MutexLock lock(mutex_);
  if (closed_) return unexpected(draining());
  const auto why = queue_.take_place(client, priority, quota, always);
  if (why == QueueRefusal::none) return std::make_unique<Place>(*this, client, quota, always);
  return unexpected(refusal_of(why, limits_, {.client = client, .priority = priority}, quota));
}

Expected<void> Scheduler::Place::add_bytes(std::int64_t bytes) {
  const MutexLock lock(scheduler_.mutex_);
  const auto why = scheduler_.queue_.add_bytes(client_, bytes, quota_, always_);
  if (why != QueueRefusal::none)
    return unexpected(refusal_of(why, scheduler_.limits_, {.client = client_, .bytes = bytes}, quota_));
  bytes_ += bytes;
  return {};
}

void Scheduler::Place::remove_bytes(std::int64_t bytes) {
  const MutexLock lock(scheduler_.mutex_);
  scheduler_.queue_.remove_bytes(client_, bytes);
  bytes_ -= bytes;
}

void Scheduler::leave(const std::string& client, std::int64_t bytes) {
  std::vector<std::weak_ptr<RoomWaiter>> waiters;
  {
    const MutexLock lock(mutex_);
    queue_.remove_bytes(client, bytes);
    queue_.leave_place(client);
    waiters.swap(room_waiters_);
  }
  for (const auto& weak : waiters) {
    if (const std::shared_ptr<RoomWaiter> waiter = weak.lock()) waiter->room();
  }
}

// The scheduler's lock is taken before a record's and the board's, never after.
void Scheduler::cancel(const std::shared_ptr<Job>& job) {
  job->stop.request_stop();
  {
    const MutexLock lock(mutex_);
    if (!queue_.remove(job.get())) return;
    look_at_waiting();
    ++finishing_;
  }
  const Clock::time_point now = Clock::now();
  const bool late = now >= job->ticket.deadline;
  Outcome outcome;
  outcome.solution =
      unexpected(late ? too_late(*job, now) : failure(ErrorCode::cancelled, "given up while the job waited"));
  finish(*job, std::move(outcome), false);
}

void Scheduler::count_refused(const Error& error) {
  const MutexLock lock(mutex_);
  ++counters_.refused;
  ++counters_.refused_by_reason[refusal_reason(error)];
}

int Scheduler::free_workers() const {
  const MutexLock lock(mutex_);
  return limits_.workers - running() - static_cast<int>(queue_.waiting());
}

void Scheduler::set_room_listener(const std::weak_ptr<RoomWaiter>& listener) {
  const MutexLock lock(mutex_);
  room_listener_ = listener;
}

bool Scheduler::is_closed() const {
  const MutexLock lock(mutex_);
  return closed_;
}

void Scheduler::learn(const Job& job, const Outcome& outcome, double run_s) {
  if (!outcome.solution) return;
  double& mean = mean_run_s_[static_cast<std::size_t>(job.ticket.priority)];
  mean += kNewest * (run_s - mean);
  if (outcome.solution->status == Status::cancelled) {
    estimates_.cut(key_of(job.ticket), run_s, Clock::now());
  } else {
    estimates_.ran(key_of(job.ticket), run_s, Clock::now());
  }
}

void Scheduler::finish(Job& job, Outcome outcome, bool ran) {
  outcome.total_s = seconds(Clock::now() - job.accepted);
  if (!ran) outcome.queue_s = outcome.total_s;
  if (!ran) outcome.retry_delay_s = retry_delay_s();  // a job that failed by itself would fail again
  job.work = nullptr;
  log_end(log_, job, outcome);
  metrics_.job_ended(counted_of(job, outcome));
  if (job.ticket.reserved) {
    if (solves(job)) job.record->answered(outcome.solution, outcome.total_s);
  } else {
    job.record->finished(outcome.solution, outcome.queue_s, outcome.total_s);
    if (!job.ticket.placed) board_.finish(job.record);
  }
  std::vector<std::weak_ptr<RoomWaiter>> waiters;
  {
    const MutexLock lock(mutex_);
    count(job, outcome);
    waiters.swap(room_waiters_);
    waiters.push_back(room_listener_);
  }
  job.observer->finished(std::move(outcome));
  job.observer = nullptr;
  for (const auto& weak : waiters) {
    if (const std::shared_ptr<RoomWaiter> waiter = weak.lock()) waiter->room();
  }
  {
    const MutexLock lock(mutex_);
    --finishing_;
  }
  progress_.notify_all();
}

void Scheduler::count(const Job& job, const Outcome& outcome) {
  if (job.ticket.reserved) {
    if (!outcome.solution || !solves(job)) return;
    ++counters_.updates;
    if (is_solved(outcome.solution->status)) ++counters_.updates_solved;
    count_answer(outcome);
    return;
  }
  if (!outcome.solution) {
    const ErrorCode code = outcome.solution.error().code;
    const bool failed = code == ErrorCode::internal || code == ErrorCode::resource_exhausted;
    ++(failed ? counters_.failed : counters_.cancelled);
    return;
  }
  const bool given_up =
      outcome.solution->status == Status::cancelled && job.stop.stop_requested() && !closed_;
  ++(given_up ? counters_.cancelled : counters_.answered);
  if (is_solved(outcome.solution->status)) ++counters_.solved;
  if (!given_up) count_answer(outcome);
}

void Scheduler::count_answer(const Outcome& outcome) {
  const Clock::time_point now = Clock::now();
  last_minute_.add(now, is_solved(outcome.solution->status));
  latencies_.add(now, outcome.total_s);
}

void Scheduler::announce_shutdown() {
  const MutexLock lock(mutex_);
  leaving_ = true;
}

bool Scheduler::is_draining() const {
  const MutexLock lock(mutex_);
  return leaving_ || closed_;
}

void Scheduler::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
}

bool Scheduler::is_drained() const {
  const MutexLock lock(mutex_);
  return closed_ && idle();
}

void Scheduler::refuse_waiting(const std::vector<std::shared_ptr<Job>>& jobs, const Error& error,
                               bool interrupted) {
  for (const auto& job : jobs) {
    Outcome outcome;
    outcome.interrupted = interrupted;
    outcome.solution = unexpected(error);
    finish(*job, std::move(outcome), false);
  }
}

void Scheduler::drain(std::chrono::duration<double> grace) {
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(grace);
  std::vector<std::shared_ptr<Job>> waiting;
  std::vector<std::weak_ptr<RoomWaiter>> room_waiters;
  {
    const MutexLock lock(mutex_);
    closed_ = true;
    room_waiters.swap(room_waiters_);
  }
  for (const auto& waiter : room_waiters) {  // they are refused
    if (const auto strong = waiter.lock()) strong->room();
  }
  {
    const MutexLock lock(mutex_);
    while (!hurried_ && !idle() && progress_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
    }
    hurried_ = true;  // sessions begin nothing more
    waiting = queue_.expire(Clock::time_point::max());
    finishing_ += static_cast<int>(waiting.size());
    for (const auto& job : running_) job->is_interrupted = job->stop.request_stop();
  }
  refuse_waiting(waiting, draining("the job was not started"), true);
  const MutexLock lock(mutex_);
  while (!idle()) progress_.wait(mutex_);
}

void Scheduler::force_shutdown() {
  {
    const MutexLock lock(mutex_);
    hurried_ = true;
  }
  progress_.notify_all();
}

void Scheduler::on_timer(Clock::time_point now) {
  std::vector<std::shared_ptr<Job>> late;
  std::vector<std::pair<std::shared_ptr<JobObserver>, QueuePlace>> places;
  {
    const MutexLock lock(mutex_);
    if (queue_.waiting() > 0) late = queue_.expire(now);
    look_at_waiting();
    finishing_ += static_cast<int>(late.size());
    const bool look =
        now - places_reported_ >= kPlaces && (queue_.waiting() > 0 || !place_listeners_.empty());
    if (look) {
      places_reported_ = now;
      queue_.update_places();
    }
    const std::vector<double> busy = look ? busy_s() : std::vector<double>();
    const auto gone = [&](const PlaceListener& listener) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
      const std::shared_ptr<Job> job = listener.job.lock();
      std::shared_ptr<JobObserver> observer = listener.observer.lock();
      if (job == nullptr || observer == nullptr || !queue_.is_waiting(job.get())) return true;
      places.emplace_back(std::move(observer), place_of(*job, busy));
      return false;
    };
    if (look) std::erase_if(place_listeners_, gone);
  }
  for (const auto& job : late) refuse_waiting({job}, too_late(*job, now), false);
  for (const auto& [observer, place] : places) observer->moved(place);
}

Counters Scheduler::counters() const {
  const MutexLock lock(mutex_);
  Counters counters = counters_;
  counters.queued = static_cast<int>(queue_.waiting());
  counters.running = running();
  counters.request_bytes = queue_.bytes();
  const Clock::time_point now = Clock::now();
  for (const auto& job : running_)
    if (!job->is_paused) counters.busy_s += seconds(now - job->begun);
  const std::vector<double> busy = busy_s();
  double work_s = 0.0;
  std::size_t ahead = 0;
  for (std::size_t at = 0; at < kPriorities; ++at) {
    const std::size_t waiting = queue_.waiting_by_priority()[at];
    ahead += waiting;
    work_s += queue_.work_s()[at];
    counters.queued_by_priority[at] = static_cast<int>(waiting);
    counters.estimated_wait_s[at] = wait_s(ahead, work_s, busy);
  }
  return counters;
}

LastMinute::Sum Scheduler::last_minute() const {
  const MutexLock lock(mutex_);
  return last_minute_.sum(Clock::now());
}

Latencies::Quantiles Scheduler::latencies(std::int64_t seconds) const {
  const MutexLock lock(mutex_);
  return latencies_.quantiles(Clock::now(), seconds);
}

double Scheduler::retry_delay_s() const {
  const MutexLock lock(mutex_);
  const double work_s = std::accumulate(queue_.work_s().begin(), queue_.work_s().end(), 0.0);
  const double one_s = *std::max_element(mean_run_s_.begin(), mean_run_s_.end());
  return std::clamp(std::max((work_s + one_s) / limits_.workers, busy_s().front()), 0.01, 10.0);
}

QueuePlace Scheduler::place(const Job& job) const {
  const MutexLock lock(mutex_);
  return place_of(job, busy_s());
}

QueuePlace Scheduler::place_of(const Job& job, const std::vector<double>& busy_s) const {
  if (!queue_.is_waiting(&job)) return {};
  const auto ahead = queue_.ahead_of(&job);
  const auto jobs = std::accumulate(ahead.begin(), ahead.end(), std::size_t{0});
  return {static_cast<int>(jobs), wait_s(jobs, queue_.work_ahead_s(&job), busy_s)};
}

std::vector<double> Scheduler::busy_s() const {
  std::vector<double> result;
  const Clock::time_point now = Clock::now();
  for (const auto& running : running_) {
    const Job& job = *running;
    if (job.is_paused || job.stop.stop_requested()) continue;  // replaced by another, or ends soon
    const double elapsed_s = seconds(now - job.begun);
    double most_s = job.time_limit_s - elapsed_s;
    if (job.ticket.deadline != Clock::time_point::max())
      most_s = std::min(most_s, seconds(job.ticket.deadline - now));
    result.push_back(time_left_s(job.ticket.expected_run_s, elapsed_s, most_s));
  }
  result.resize(static_cast<std::size_t>(limits_.workers), 0.0);
  std::sort(result.begin(), result.end());
  return result;
}

double Scheduler::wait_s(std::size_t ahead, double work_s, const std::vector<double>& busy_s) const {
  const bool waits = running() + static_cast<int>(ahead) >= limits_.workers;
  return waits ? wait_for_worker_s(busy_s, work_s) : 0.0;
}

}  // namespace marble::server
