#include "tally.h"

#include <atomic>

#include "marble/convert.h"

namespace marble::load {
namespace {

std::int64_t ns(Clock::duration d) { return std::chrono::duration_cast<std::chrono::nanoseconds>(d).count(); }
std::int64_t ns(double seconds) { return static_cast<std::int64_t>(1e9 * seconds); }

template <class Map>
void add_counts(Map& to, const Map& from) {
  for (const auto& [key, count] : from) to[key] += count;
}

std::size_t thread_number() {
  static std::atomic<std::size_t> threads = 0;
  thread_local const std::size_t number = threads++;
  return number;
}

void add_answer(EntryTally& tally, const Work& work, const v1::Solution& solution, Clock::time_point now) {
  const std::int64_t service = ns(now - work.sent);
  const v1::Times& times = solution.times();
  tally.latency.add(ns(now - work.intended));
  tally.service.add(service);
  tally.queue.add(ns(times.queue_s()));
  tally.solve.add(ns(times.solve_s()));
  tally.run.add(ns(times.total_s() - times.queue_s()));
  tally.outside.add(service - ns(times.total_s()));
  ++tally.answers;
  ++tally.statuses[to_string(status_of(solution.status()))];
}

void add_error(EntryTally& tally, const Work& work, const Reply& reply, Clock::time_point now) {
  tally.refusal.add(ns(now - work.sent));
  ++tally.errors[reply.error];
  tally.with_retry_info += reply.retry_info ? 1 : 0;
}

}  // namespace

void EntryTally::merge(const EntryTally& other) {
  latency.merge(other.latency);
  service.merge(other.service);
  queue.merge(other.queue);
  solve.merge(other.solve);
  run.merge(other.run);
  outside.merge(other.outside);
  refusal.merge(other.refusal);
  answers += other.answers;
  add_counts(statuses, other.statuses);
  add_counts(errors, other.errors);
  with_retry_info += other.with_retry_info;
  progress_rows += other.progress_rows;
  progress_skipped += other.progress_skipped;
}

void EntryTally::clear() {
  for (Histogram* histogram : {&latency, &service, &queue, &solve, &run, &outside, &refusal})
    histogram->clear();
  answers = with_retry_info = progress_rows = progress_skipped = 0;
  statuses.clear();
  errors.clear();
}

std::uint64_t EntryTally::error_count() const {
  std::uint64_t count = 0;
  for (const auto& [code, times] : errors) count += times;
  return count;
}

void Tally::merge(const Tally& other) {
  for (std::size_t i = 0; i < entries.size(); ++i) entries[i].merge(other.entries[i]);
  lag.merge(other.lag);
  ended_answers += other.ended_answers;
  ended_errors += other.ended_errors;
  for (const auto& [code, text] : other.messages) messages.emplace(code, text);
}

void Tally::clear() {
  for (EntryTally& entry : entries) entry.clear();
  lag.clear();
  ended_answers = ended_errors = 0;
  messages.clear();
}

EntryTally Tally::sum() const {
  EntryTally result;
  for (const EntryTally& entry : entries) result.merge(entry);
  return result;
}

Recorder::Recorder(std::size_t entries) : entries_(entries) {
  for (Shard& shard : shards_) {
    const MutexLock lock(shard.mutex);
    shard.tally = Tally(entries);
  }
}

void Recorder::add(const Work& work, const Reply& reply, Clock::time_point now) {
  Shard& shard = shards_[thread_number() % shards_.size()];
  const MutexLock lock(shard.mutex);
  Tally& tally = shard.tally;
  const bool answered = reply.error.empty();
  ++(answered ? tally.ended_answers : tally.ended_errors);
  if (!work.measured) return;
  tally.lag.add(ns(work.sent - work.intended));
  EntryTally& entry = tally.entries[work.entry];
  entry.progress_rows += static_cast<std::uint64_t>(reply.progress_rows);
  entry.progress_skipped += static_cast<std::uint64_t>(reply.progress_skipped);
  if (answered) return add_answer(entry, work, reply.solution, now);
  add_error(entry, work, reply, now);
  tally.messages.emplace(reply.error, reply.error_message);
}

Tally Recorder::take() {
  Tally result(entries_);
  for (Shard& shard : shards_) {
    const MutexLock lock(shard.mutex);
    result.merge(shard.tally);
    shard.tally.clear();
  }
  return result;
}

}  // namespace marble::load
