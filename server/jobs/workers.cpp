// The work of a worker's thread: jobs, tasks of other jobs, and more urgent jobs that preempt either.
#include <algorithm>
#include <exception>
#include <new>

#include "jobs/scheduler.h"

namespace marble::server {
namespace {

// Sends progress to the job's record and to its observer.
class ProgressSplitter final : public ProgressSink {
 public:
  explicit ProgressSplitter(Job& job) : record_(*job.record), observer_(job.observer->progress()) {}
  void report(const Progress& progress) override {
    record_.report(progress);
    if (observer_ != nullptr) observer_->report(progress);
  }
  [[nodiscard]] bool wants_pairs() const override { return record_.wants_pairs(); }

 private:
  JobRecord& record_;
  ProgressSink* const observer_;
};

// Every failure inside a job is caught here and becomes an error of that job alone.
Expected<Solution> solve(Job& job, TaskRunner& runner, Pause* pause, const std::stop_token& stop) {
  try {
    ProgressSplitter progress(job);
    SolveControls controls;
    controls.progress = &progress;
    controls.activity = &job.record->activity();
    controls.stop = stop;
    controls.runner = &runner;
    controls.pause = pause;
    return job.work(controls);
  } catch (const std::bad_alloc&) {
    return unexpected(does_not_fit());
  } catch (const std::exception& error) {
    return unexpected(failure(ErrorCode::internal, error.what()));
  }
}

// The record restarts whenever the work starts.
void report_started(Job& job, double queue_s) {
  job.record->started(queue_s);
  if (!std::exchange(job.has_started, true)) job.observer->started(queue_s);
}

}  // namespace

// Lets a running job be preempted, also one that preempted another: there are as many on a thread as
// priorities, at most. For each pause, the job runs an eighth as long before the next one, so it
// always progresses.
class Scheduler::SteppingAside final : public Pause {
 public:
  SteppingAside(Scheduler& scheduler, Job& job) : scheduler_(scheduler), job_(job) {}

  void look() override {
    if (scheduler_.most_urgent_.load(std::memory_order_relaxed) >=
        static_cast<std::size_t>(job_.ticket.priority))
      return;
    const Clock::time_point begin = Clock::now();
    if (begin < goes_on_until_.load(std::memory_order_relaxed)) return;
    const bool own_thread = std::this_thread::get_id() == owner_;
    if (!scheduler_.run_urgent(job_, own_thread)) return;
    const Clock::time_point end = Clock::now();
    if (own_thread) paused_.store(paused() + (end - begin), std::memory_order_relaxed);
    goes_on_until_.store(end + (end - begin) / 8, std::memory_order_relaxed);
  }
  [[nodiscard]] Clock::duration paused() const override { return paused_.load(std::memory_order_relaxed); }

 private:
  Scheduler& scheduler_;
  Job& job_;
  const std::thread::id owner_ = std::this_thread::get_id();
  std::atomic<Clock::duration> paused_ = Clock::duration();  // time in which the owner was paused
  std::atomic<Clock::time_point> goes_on_until_ = Clock::time_point();
};

// Ends a solve on a thread that must not be used for long.
class Scheduler::HereLimit final : public Pause {
 public:
  HereLimit(Clock::time_point until, std::stop_source& stop) : until_(until), stop_(stop) {}
  void look() override {
    if (is_reached_.load(std::memory_order_relaxed) || Clock::now() < until_) return;
    is_reached_.store(true, std::memory_order_relaxed);
    stop_.request_stop();
  }
  [[nodiscard]] Clock::duration paused() const override { return {}; }
  [[nodiscard]] bool is_reached() const { return is_reached_.load(std::memory_order_relaxed); }

 private:
  const Clock::time_point until_;
  std::stop_source& stop_;
  std::atomic<bool> is_reached_ = false;  // helpers read it too
};

// Waiting jobs go before tasks of other jobs.
Scheduler::Next Scheduler::next() {
  const MutexLock lock(mutex_);
  while (true) {
    if (!begun_here_.empty()) {
      --here_;
      std::shared_ptr<Job> job = std::move(begun_here_.back());
      begun_here_.pop_back();
      job->begun = Clock::now();
      return {.job = std::move(job)};
    }
    // A job that runs in the place of an idle worker leaves no worker for another job.
    std::shared_ptr<Job> job = running() < limits_.workers ? queue_.pop(Clock::now()) : nullptr;
    if (job != nullptr) {
      look_at_waiting();
      job->begun = Clock::now();
      running_.push_back(job);
      return {.job = std::move(job)};
    }
    if (stopping_) return {};
    if (!shared_tasks_.empty()) {
      SharedTasks& shared = *shared_tasks_.front();
      ++shared.helpers;
      return {.job = nullptr, .shared = &shared, .task = &begin_task(shared)};
    }
    ++idle_;
    work_.wait(mutex_);
    --idle_;
  }
}

void Scheduler::look_at_waiting() { most_urgent_.store(queue_.most_urgent(), std::memory_order_relaxed); }

bool Scheduler::run_urgent(Job& paused, bool own_thread) {
  std::shared_ptr<Job> job;
  {
    const MutexLock lock(mutex_);
    if (idle_ <= here_) job = queue_.pop_above(paused.ticket.priority);
    if (job == nullptr) return false;
    look_at_waiting();
    job->begun = Clock::now();
    running_.push_back(job);
    if (own_thread) paused.is_paused = true, ++paused_;
  }
  run_job(job);
  const MutexLock lock(mutex_);
  if (own_thread) paused.is_paused = false, --paused_;
  return true;
}

void Scheduler::work() {
  while (true) {
    const Next next = this->next();
    if (next.job != nullptr) {
      run_job(next.job);
    } else if (next.task != nullptr) {
      (*next.task)();
      const MutexLock lock(mutex_);
      --next.shared->helpers;
      helped_.notify_all();
    } else {
      return;
    }
  }
}

// There must be one.
const std::function<void()>& Scheduler::begin_task(SharedTasks& shared) {
  const std::function<void()>& task = shared.tasks[shared.next++];
  if (shared.next == shared.tasks.size())
    shared_tasks_.erase(std::find(shared_tasks_.begin(), shared_tasks_.end(), &shared));
  return task;
}

// The shared tasks may be on the stack, because they outlive every use: they are in shared_tasks_ only while
// there are tasks to begin, and each thread that took them from there counts as a helper, for which this
// function waits. No task throws.
void Scheduler::run(std::span<const std::function<void()>> tasks) {
  if (tasks.empty()) return;  // begin_task would never remove it
  SharedTasks shared{tasks};
  const auto next_task = [&]() ABSL_LOCKS_EXCLUDED(mutex_) -> const std::function<void()>* {
    const MutexLock lock(mutex_);
    return shared.next < tasks.size() ? &begin_task(shared) : nullptr;
  };
  {
    const MutexLock lock(mutex_);
    shared_tasks_.push_back(&shared);
  }
  work_.notify_all();
  while (const auto* const task = next_task()) (*task)();
  const MutexLock lock(mutex_);
  while (shared.helpers > 0) helped_.wait(mutex_);
}

void Scheduler::run_job(const std::shared_ptr<Job>& job) {
  const Clock::time_point begin = job->begun;
  SteppingAside pause(*this, *job);
  Outcome outcome;
  outcome.queue_s = seconds(begin - job->accepted);
  if (job->ticket.deadline != Clock::time_point::max() &&
      job->ticket.deadline - begin <= job->ticket.least_run) {
    outcome.solution = unexpected(too_late(*job, begin));
  } else {
    report_started(*job, outcome.queue_s);
    outcome.solution = solve(*job, *this, &pause, job->stop.get_token());
  }
  end_job(job, std::move(outcome), pause.paused());
}

Expected<QueuePlace> Scheduler::admit_here(const std::shared_ptr<Job>& job) {
  bool here = false;
  Expected<QueuePlace> place = enqueue(job, {}, &here);
  if (!place) return place;
  if (here) {
    run_here(job);
  } else {
    work_.notify_one();
  }
  return place;
}

bool Scheduler::begin_here(const std::shared_ptr<Job>& job) {
  const double longest_s = estimates_.longest_s(key_of(job->ticket));
  const bool is_short = longest_s > 0.0 && longest_s < 0.5 * seconds(kMostHere);
  const bool has_time = Clock::now() + kMostHere < job->ticket.deadline;
  if (!is_short || !has_time || idle_ <= here_ || queue_.waiting() != 1) return false;
  if (queue_.pop(Clock::now()) == nullptr) return false;  // the job's client is at its quota
  look_at_waiting();
  job->begun = Clock::now();
  running_.push_back(job);
  ++here_;
  return true;
}

void Scheduler::run_here(const std::shared_ptr<Job>& job) {
  Outcome outcome;
  outcome.queue_s = seconds(job->begun - job->accepted);
  report_started(*job, outcome.queue_s);
  std::stop_source stop;
  HereLimit limit(job->begun + kMostHere, stop);
  {
    const std::stop_callback forward(job->stop.get_token(), [&stop] { stop.request_stop(); });
    outcome.solution = solve(*job, *this, &limit, stop.get_token());
  }
  // Even if it is solved: a search after the solution may have been cut short.
  if (limit.is_reached() && !job->stop.stop_requested()) {
    {
      const MutexLock lock(mutex_);
      begun_here_.push_back(job);
    }
    work_.notify_one();
    return;
  }
  end_job(job, std::move(outcome), {});
  const MutexLock lock(mutex_);
  --here_;
}

void Scheduler::end_job(const std::shared_ptr<Job>& job, Outcome outcome, Clock::duration paused) {
  const Clock::time_point begin = job->begun;
  outcome.also = std::move(job->also);
  job->work = nullptr;  // before its bytes are released: a result may wait long for its reader
  bool others_ready = false;
  {
    const MutexLock lock(mutex_);
    ++finishing_;
    queue_.done(job.get());
    running_.erase(std::find(running_.begin(), running_.end(), job));
    const double run_s = seconds(Clock::now() - begin - paused);
    counters_.busy_s += run_s;
    client_uses_.add(Clock::now(), job->ticket.client, run_s, outcome.solution.has_value() && solves(*job));
    learn(*job, outcome, run_s);
    others_ready = queue_.ready();
    outcome.interrupted =
        job->is_interrupted && outcome.solution && outcome.solution->status == Status::cancelled;
  }
  if (others_ready) work_.notify_one();  // their client may have been at its quota
  finish(*job, std::move(outcome), true);
}

}  // namespace marble::server
