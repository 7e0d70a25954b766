#include "scheduler.h"

#include <algorithm>
#include <exception>
#include <new>

#include "marble/solver.h"

namespace marble::server {
namespace {

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

// Everything a job can do to itself ends here, as an error of that job alone.
Expected<Solution> solve_job(Job& job) {
  try {
    auto solver = Solver::create(job.problem, job.options);
    if (!solver) return unexpected(solver.error());
    SolveControls controls;
    controls.progress = job.observer->progress();
    controls.stop = job.stop.get_token();
    controls.initial_z = job.initial_z;
    return solver->solve(controls);
  } catch (const std::bad_alloc&) {
    return unexpected(out_of_memory());
  } catch (const std::exception& error) {
    return unexpected(Error{ErrorCode::internal, "", -1, "", error.what()});
  }
}

}  // namespace

Scheduler::Scheduler(const SchedulerLimits& limits, const Log& log)
    : limits_(limits), log_(log), queue_(static_cast<std::size_t>(limits.queue_jobs + limits.workers)) {
  // A worker that is about to take a job counts as room in the queue, so that queue_jobs = 0 means "no
  // waiting".
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

Expected<int> Scheduler::admit(std::shared_ptr<Job> job) {
  const MutexLock lock(mutex_);
  const auto refuse = [](ErrorCode code, std::string field, std::string value, std::string bound) {
    return unexpected(Error{code, std::move(field), -1, std::move(value), std::move(bound)});
  };
  if (closed_) return refuse(ErrorCode::unavailable, "", "", "the server is draining; retry elsewhere");
  if (counters_.queued + counters_.running >= limits_.queue_jobs + limits_.workers) {
    return refuse(ErrorCode::resource_exhausted, "queue_jobs", std::to_string(counters_.queued) + " waiting",
                  "the queue holds at most " + std::to_string(limits_.queue_jobs) + " jobs");
  }
  if (bytes_ + job->bytes > limits_.queue_bytes) {
    return refuse(ErrorCode::resource_exhausted, "queue_bytes", std::to_string(bytes_ + job->bytes),
                  "requests may take at most " + std::to_string(limits_.queue_bytes) + " bytes together");
  }
  const int before = counters_.queued;
  bytes_ += job->bytes;
  ++counters_.accepted;
  ++counters_.queued;
  if (!queue_.push(std::move(job))) std::terminate();  // the bound above is the tighter one
  work_.notify_one();
  return before;
}

void Scheduler::cancel(const std::shared_ptr<Job>& job) {
  job->stop.request_stop();
  {
    const MutexLock lock(mutex_);
    if (!queue_.remove(job.get())) return;
    --counters_.queued;
    ++finishing_;
  }
  const bool late = Clock::now() >= job->deadline;
  Outcome outcome;
  outcome.solution = unexpected(
      Error{late ? ErrorCode::deadline_exceeded : ErrorCode::cancelled, "", -1, "",
            late ? "the deadline passed while the job waited" : "the client gave up while the job waited"});
  finish(*job, std::move(outcome), false);
}

void Scheduler::count_refused() {
  const MutexLock lock(mutex_);
  ++counters_.refused;
}

std::shared_ptr<Job> Scheduler::next() {
  const MutexLock lock(mutex_);
  while (!stopping_ && queue_.size() == 0) work_.wait(mutex_);
  std::shared_ptr<Job> job = queue_.pop();
  if (job != nullptr) {
    --counters_.queued;
    ++counters_.running;
    running_.push_back(job);
  }
  return job;
}

void Scheduler::work() {
  while (const std::shared_ptr<Job> job = next()) run(*job);
}

void Scheduler::run(Job& job) {
  const Clock::time_point begin = Clock::now();
  Outcome outcome;
  outcome.queue_s = seconds(begin - job.accepted);
  if (begin >= job.deadline) {
    outcome.solution = unexpected(
        Error{ErrorCode::deadline_exceeded, "", -1, "", "the deadline passed while the job waited"});
  } else {
    job.observer->started(outcome.queue_s);
    outcome.solution = solve_job(job);
  }
  {
    const MutexLock lock(mutex_);
    --counters_.running;
    ++finishing_;
    running_.erase(
        std::find_if(running_.begin(), running_.end(), [&](const auto& r) { return r.get() == &job; }));
    mean_solve_s_ += 0.1 * (seconds(Clock::now() - begin) - mean_solve_s_);
  }
  finish(job, std::move(outcome), true);
}

void Scheduler::finish(Job& job, Outcome outcome, bool ran) {
  outcome.total_s = seconds(Clock::now() - job.accepted);
  if (!ran) outcome.queue_s = outcome.total_s;
  outcome.retry_delay_s = retry_delay_s();
  log_end(job, outcome);
  job.request = nullptr;  // before its bytes are counted free: an answer may wait long for its reader
  {
    const MutexLock lock(mutex_);
    bytes_ -= job.bytes;
    count(job, outcome);
  }
  job.observer->finished(std::move(outcome));
  job.observer = nullptr;
  {
    const MutexLock lock(mutex_);
    --finishing_;
  }
  progress_.notify_all();
}

void Scheduler::count(const Job& job, const Outcome& outcome) {
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
}

void Scheduler::log_end(const Job& job, const Outcome& outcome) const {
  const auto text = [&]() -> std::string {
    return outcome.solution ? to_string(outcome.solution->status) : to_string(outcome.solution.error().code);
  };
  const bool solved = outcome.solution.has_value();
  const auto fields = {Log::Field{"job", job.id},
                       {"request", job.request_id},
                       {"name", job.name},
                       {"peer", job.peer},
                       {"n", std::int64_t{job.problem.variables()}},
                       {"n_e", std::int64_t{job.problem.equalities()}},
                       {"n_i", std::int64_t{job.problem.inequalities()}},
                       {"n_c", std::int64_t{job.problem.pairs()}},
                       {"status", text()},
                       {"iterations", std::int64_t{solved ? outcome.solution->iterations : 0}},
                       {"factorizations", std::int64_t{solved ? outcome.solution->factorizations : 0}},
                       {"objective", solved ? outcome.solution->objective : 0.0},
                       {"queue_s", outcome.queue_s},
                       {"solve_s", solved ? outcome.solution->times.solve_s : 0.0},
                       {"total_s", outcome.total_s},
                       {"detail", solved ? outcome.solution->detail : outcome.solution.error().message()}};
  if (!solved && outcome.solution.error().code == ErrorCode::internal) {
    log_.error("job", fields);
  } else {
    log_.info("job", fields);
  }
}

void Scheduler::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
}

void Scheduler::drain(std::chrono::duration<double> grace) {
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(grace);
  std::vector<std::shared_ptr<Job>> waiting;
  {
    const MutexLock lock(mutex_);
    closed_ = true;
    while (!hurried_ && !idle() && progress_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
    }
    while (std::shared_ptr<Job> job = queue_.pop()) {
      --counters_.queued;
      ++finishing_;
      waiting.push_back(std::move(job));
    }
    for (const auto& job : running_) job->stop.request_stop();
  }
  for (const auto& job : waiting) {
    Outcome outcome;
    outcome.solution = unexpected(
        Error{ErrorCode::unavailable, "", -1, "", "the server is draining; the job was not started"});
    finish(*job, std::move(outcome), false);
  }
  const MutexLock lock(mutex_);
  while (!idle()) progress_.wait(mutex_);
}

void Scheduler::hurry() {
  {
    const MutexLock lock(mutex_);
    hurried_ = true;
  }
  progress_.notify_all();
}

Counters Scheduler::counters() const {
  const MutexLock lock(mutex_);
  return counters_;
}

double Scheduler::retry_delay_s() const {
  const MutexLock lock(mutex_);
  return std::clamp(mean_solve_s_ * (counters_.queued + 1) / limits_.workers, 0.01, 10.0);
}

}  // namespace marble::server
