// How many log lines a client may cause, so that none floods the log; what is held back is counted.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "log/log_levels.h"
#include "mutex.h"

namespace marble::server {

/// A kind of line.
struct LogEvent {
  LogLevel level;
  Component component;
  const char* name;  ///< lives for ever
};

/// A token bucket for each event and client, and one for each event as a whole. Thread-safe.
class LogLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// Clients of which is known how much they have logged; beyond it the longest silent is forgotten.
  static constexpr std::size_t kMostSources = 1024;
  /// All clients together, as a multiple of what one may: who changes its name all the time comes no further.
  static constexpr double kAllTogether = 20.0;
  /// Silence after which what was held back is told without waiting for a line that passes.
  static constexpr std::chrono::seconds kQuiet{1};

  /// Lines a second of one client and event, as many at once; 0 is no limit.
  void set_rate(double lines_per_s) { lines_per_s_ = lines_per_s; }

  struct Verdict {
    bool passes = true;
    std::int64_t suppressed = 0;  ///< of the same event and client, since its last line that passed
  };
  [[nodiscard]] Verdict ask(const LogEvent& event, std::string_view client, Time now)
      ABSL_LOCKS_EXCLUDED(mutex_);

  /// What was held back and is not told yet.
  struct Suppressed {
    LogEvent event;
    std::string client;  ///< empty: of several that are forgotten
    std::int64_t lines = 0;
  };
  /// Of those that were silent for kQuiet.
  [[nodiscard]] std::vector<Suppressed> take_quiet(Time now) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::vector<Suppressed> take_all() { return take_quiet(Time::max()); }

 private:
  struct Bucket {
    double tokens;
    Time filled;
    [[nodiscard]] bool take(double per_s, Time now);
  };
  struct Source {
    Suppressed suppressed;
    Bucket bucket;
    Time last;  // held back
  };
  using EventKey = std::pair<Component, std::string_view>;
  using Key = std::tuple<Component, std::string_view, std::string_view>;  // the client is a Source's own text
  struct Total {
    Bucket bucket;
    Suppressed suppressed;  // of forgotten sources
    Time last;
  };
  [[nodiscard]] Source& source_of(const LogEvent& event, std::string_view client, double per_s, Time now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void forget_oldest() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] Total& total_of(const LogEvent& event, double per_s, Time now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  std::atomic<double> lines_per_s_ = 0.0;
  Mutex mutex_;
  std::list<Source> sources_ ABSL_GUARDED_BY(mutex_);  // the one that asked last comes first
  std::map<Key, std::list<Source>::iterator> by_key_ ABSL_GUARDED_BY(mutex_);
  std::map<EventKey, Total> totals_ ABSL_GUARDED_BY(mutex_);
  std::int64_t untold_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::server
