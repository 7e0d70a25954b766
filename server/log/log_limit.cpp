#include "log/log_limit.h"

#include <algorithm>
#include <utility>

namespace marble::server {
namespace {

constexpr std::size_t kLongestClient = 256;  // bytes of a name that distinguish clients

double burst(double per_s) { return std::max(1.0, per_s); }

}  // namespace

bool LogLimit::Bucket::take(double per_s, Time now) {
  const double waited_s = std::chrono::duration<double>(now - filled).count();
  tokens = std::min(burst(per_s), tokens + per_s * std::max(0.0, waited_s));
  filled = now;
  if (tokens < 1.0) return false;
  tokens -= 1.0;
  return true;
}

LogLimit::Verdict LogLimit::ask(const LogEvent& event, std::string_view client, Time now) {
  const double per_s = lines_per_s_;
  if (per_s <= 0.0) return {};
  const MutexLock lock(mutex_);
  Source& source = source_of(event, client.substr(0, kLongestClient), per_s, now);
  if (source.bucket.take(per_s, now) &&
      total_of(event, kAllTogether * per_s, now).bucket.take(kAllTogether * per_s, now)) {
    const std::int64_t lines = std::exchange(source.suppressed.lines, 0);
    unreported_ -= lines;
    return {true, lines};
  }
  ++source.suppressed.lines;
  ++unreported_;
  source.last = now;
  return {false, 0};
}

LogLimit::Source& LogLimit::source_of(const LogEvent& event, std::string_view client, double per_s,
                                      Time now) {
  if (const auto found = by_key_.find({event.component, event.name, client}); found != by_key_.end()) {
    sources_.splice(sources_.begin(), sources_, found->second);
    return sources_.front();
  }
  if (sources_.size() == kMostSources) forget_oldest();
  sources_.push_front({{event, std::string(client), 0}, {burst(per_s), now}, now});
  by_key_.emplace(Key(event.component, event.name, sources_.front().suppressed.client), sources_.begin());
  return sources_.front();
}

void LogLimit::forget_oldest() {
  const Source& oldest = sources_.back();
  const Suppressed& last = oldest.suppressed;
  Total& total =
      totals_.find({last.event.component, last.event.name})->second;  // exists since the source's first line
  total.suppressed.lines += last.lines;
  total.last = std::max(total.last, oldest.last);
  by_key_.erase({last.event.component, last.event.name, last.client});
  sources_.pop_back();
}

LogLimit::Total& LogLimit::total_of(const LogEvent& event, double per_s, Time now) {
  return totals_.try_emplace({event.component, event.name}, Total{{burst(per_s), now}, {event, "", 0}, now})
      .first->second;
}

std::vector<LogLimit::Suppressed> LogLimit::take_quiet(Time now) {
  std::vector<Suppressed> result;
  const MutexLock lock(mutex_);
  if (unreported_ == 0) return result;
  const auto take = [&](Suppressed& suppressed, Time last) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (suppressed.lines == 0 || now < last + kQuiet) return;
    result.push_back(suppressed);
    unreported_ -= std::exchange(suppressed.lines, 0);
  };
  for (Source& source : sources_) take(source.suppressed, source.last);
  for (auto& [key, total] : totals_) take(total.suppressed, total.last);
  return result;
}

}  // namespace marble::server
