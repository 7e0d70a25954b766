#include "jobs/job_record.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace marble::server {

JobRecord::JobRecord(JobDescription description, const Options& options, int trace_rows, int trace_pairs)
    : description_(std::move(description)),
      wants_pairs_(description_.pairs > 0 && trace_pairs > 0),
      options_(options),
      history_(trace_rows),
      pairs_(static_cast<std::size_t>(trace_pairs)) {}

void JobRecord::changed() {
  ++snapshot_.version;
  changes_.fetch_add(1, std::memory_order_release);
}

void JobRecord::queued() {
  const MutexLock lock(mutex_);
  snapshot_.state = JobState::queued;
  changed();
}

void JobRecord::started(double queue_s) {
  const MutexLock lock(mutex_);
  snapshot_.state = JobState::running;
  snapshot_.queue_s = queue_s;
  history_.begin();
  pairs_.begin();
  changed();
}

void JobRecord::idle() {
  const MutexLock lock(mutex_);
  snapshot_.state = JobState::idle;
  changed();
}

void JobRecord::set_memory(std::int64_t bytes) {
  const MutexLock lock(mutex_);
  snapshot_.memory_bytes = bytes;
  changed();
}

void JobRecord::set_options(const Options& options) {
  const MutexLock lock(mutex_);
  options_ = options;
}

void JobRecord::report(const Progress& progress) {
  const MutexLock lock(mutex_);
  history_.put(progress);
  if (!progress.s.empty() && wants_pairs_) pairs_.put(progress);
  snapshot_.iterations = earlier_iterations_ + progress.iteration;
  snapshot_.factorizations = earlier_factorizations_ + progress.factorizations;
  snapshot_.objective = progress.objective;
  snapshot_.violations = progress.violations;
  snapshot_.incumbent = progress.incumbent;
  take_tree(progress);
  changes_.fetch_add(1, std::memory_order_release);
}

void JobRecord::add_stage(const SampleAverageStage& stage) {
  const MutexLock lock(mutex_);
  snapshot_.stages.push_back(stage);
  snapshot_.stages.back().x = {};  // borrowed from the caller
  changed();
}

std::vector<SampleAverageStage> JobRecord::stages_from(std::size_t first) const {
  const MutexLock lock(mutex_);
  const std::vector<SampleAverageStage>& stages = snapshot_.stages;
  return {stages.begin() + static_cast<std::ptrdiff_t>(std::min(first, stages.size())), stages.end()};
}

template <class Reported>
void JobRecord::take_tree(const Reported& reported) {
  snapshot_.bound = reported.bound;
  snapshot_.gap = reported.gap;
  snapshot_.nodes = reported.nodes;
  snapshot_.open_nodes = reported.open_nodes;
}

JobRecord::Why JobRecord::why_of(const Expected<Solution>& solution) const {
  if (!solution) return nullptr;
  const auto count = [](Index number) { return static_cast<std::size_t>(number); };
  const JobDescription& of = description_;
  return infeasibility_of(*solution, count(of.equalities) + count(of.inequalities) + 2 * count(of.pairs));
}

void JobRecord::take(const Solution& solution, Why why) {
  snapshot_.status = solution.status;
  snapshot_.detail = solution.detail;
  snapshot_.error.reset();
  snapshot_.iterations = earlier_iterations_ + solution.iterations;
  snapshot_.factorizations = earlier_factorizations_ + solution.factorizations;
  snapshot_.objective = solution.objective;
  snapshot_.violations = solution.violations;
  take_tree(solution);
  // Of a tree whose solution is not solved and has no gap, the newest row has the incumbent.
  if (solution.nodes == 0 || std::isfinite(solution.gap) || is_solved(solution.status))
    snapshot_.incumbent = solution.nodes == 0 ? Progress{}.incumbent : solution.objective;
  snapshot_.proved = solution.proved;
  snapshot_.infeasibility = std::move(why);
  snapshot_.times = solution.times;
}

void JobRecord::answered(const Expected<Solution>& solution, double total_s) {
  Why why = why_of(solution);
  const MutexLock lock(mutex_);
  if (solution) {
    take(*solution, std::move(why));
  } else {
    snapshot_.error = solution.error();
  }
  snapshot_.total_s = total_s;
  ++snapshot_.updates;
  earlier_iterations_ = snapshot_.iterations;
  earlier_factorizations_ = snapshot_.factorizations;
  snapshot_.state = JobState::idle;
  changed();
}

void JobRecord::end() {
  snapshot_.state = JobState::finished;
  // The clock that accepted it may be another server's, or the store's.
  snapshot_.finished =
      snapshot_.server.empty()
          ? std::chrono::system_clock::now()
          : description_.accepted + std::chrono::duration_cast<std::chrono::system_clock::duration>(
                                        std::chrono::duration<double>(snapshot_.total_s));
  if (watchers_ == 0) history_.end();
  cancel_ = nullptr;
  place_ = nullptr;
  changed();
}

void JobRecord::finished(const Expected<Solution>& solution, double queue_s, double total_s) {
  Why why = why_of(solution);
  const MutexLock lock(mutex_);
  if (solution) {
    take(*solution, std::move(why));
  } else {
    snapshot_.error = solution.error();
  }
  snapshot_.queue_s = queue_s;
  snapshot_.total_s = total_s;
  end();
}

void JobRecord::closed(const std::optional<Error>& reason) {
  const MutexLock lock(mutex_);
  snapshot_.error = reason;
  end();
}

void JobRecord::set_array(const ArrayCounts& counts, std::int64_t result_bytes) {
  const MutexLock lock(mutex_);
  snapshot_.array = counts;
  snapshot_.iterations = counts.iterations;
  snapshot_.factorizations = counts.factorizations;
  snapshot_.result_bytes = result_bytes;
  snapshot_.detail = std::to_string(counts.done) + " of " + std::to_string(counts.elements) +
                     " elements: " + std::to_string(counts.solved) + " solved, " +
                     std::to_string(counts.failed) + " with an error";
  changed();
}

void JobRecord::array_ended(const std::optional<Error>& reason, double total_s) {
  const MutexLock lock(mutex_);
  snapshot_.error = reason;
  snapshot_.total_s = total_s;
  end();
}

void JobRecord::set_result_bytes(std::int64_t bytes) {
  const MutexLock lock(mutex_);
  snapshot_.result_bytes = bytes;
  changed();
}

void JobRecord::restore(JobSnapshot snapshot, Trace trace) {
  const MutexLock lock(mutex_);
  history_.restore(std::move(trace.rows), trace.stride);
  pairs_.restore(std::move(trace.pairs));
  const std::int64_t version = snapshot_.version;
  snapshot_ = std::move(snapshot);
  snapshot_.version = version;
  if (snapshot_.state == JobState::finished) {
    if (watchers_ == 0) history_.end();
    place_ = nullptr;
  }
  changed();
}

void JobRecord::follow(std::int64_t skipped, const std::vector<Progress>& rows) {
  const MutexLock lock(mutex_);
  if (skipped > 0) history_.skip(skipped);
  for (const Progress& row : rows) history_.put(row);
  changes_.fetch_add(1, std::memory_order_release);
}

void JobRecord::set_server(const std::string& server) {
  const MutexLock lock(mutex_);
  snapshot_.server = server;
  changed();
}

JobSnapshot JobRecord::snapshot() const {
  const MutexLock lock(mutex_);
  return snapshot_;
}

bool JobRecord::is_finished() const {
  const MutexLock lock(mutex_);
  return snapshot_.state == JobState::finished;
}

bool JobRecord::is_running() const {
  const MutexLock lock(mutex_);
  return snapshot_.state == JobState::running;
}

Options JobRecord::options() const {
  const MutexLock lock(mutex_);
  return options_;
}

JobRecord::Trace JobRecord::trace() const {
  const MutexLock lock(mutex_);
  return {history_.trace(), history_.stride(), history_.count(), pairs_.frames()};
}

ProgressHistory::Rows JobRecord::read(std::int64_t& cursor) const {
  const MutexLock lock(mutex_);
  return history_.read(cursor);
}

Progress JobRecord::newest() const {
  const MutexLock lock(mutex_);
  return history_.newest();
}

std::optional<PairHistory::Frame> JobRecord::newest_pairs() const {
  const MutexLock lock(mutex_);
  if (pairs_.empty()) return std::nullopt;
  return pairs_.newest();
}

void JobRecord::watch(bool begin) {
  const MutexLock lock(mutex_);
  watchers_ += begin ? 1 : -1;
  if (watchers_ == 0 && snapshot_.state == JobState::finished) history_.end();
}

bool JobRecord::is_watched() const {
  const MutexLock lock(mutex_);
  return watchers_ > 0;
}

void JobRecord::set_cancel(std::function<void()> cancel) {
  const MutexLock lock(mutex_);
  if (snapshot_.state != JobState::finished) cancel_ = std::move(cancel);
}

void JobRecord::set_place(std::function<QueuePlace()> place) {
  const MutexLock lock(mutex_);
  if (snapshot_.state != JobState::finished) place_ = std::move(place);
}

QueuePlace JobRecord::place() const {
  std::function<QueuePlace()> ask;
  {
    const MutexLock lock(mutex_);
    ask = place_;
  }
  return ask ? ask() : QueuePlace{};
}

void JobRecord::cancel() {
  std::function<void()> ask;
  {
    const MutexLock lock(mutex_);
    ask = cancel_;
  }
  if (ask) ask();
}

}  // namespace marble::server
