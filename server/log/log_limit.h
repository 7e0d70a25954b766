// Limits the log lines that a client may cause, so that none floods the log; suppressed lines are counted.
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
  const char* name;  ///< must have static lifetime
};

/// A token bucket for each event and client, and one for each event as a whole. Thread-safe.
class LogLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// Number of clients whose lines are counted; beyond it the one that is idle for longest is dropped.
  static constexpr std::size_t kMostSources = 1024;
  /// Limit of all clients together, as a multiple of one client's: a client that keeps changing its name
  /// gains nothing more.
  static constexpr double kAllTogether = 20.0;
  /// Idle time after which suppressed lines are reported without waiting for a line that passes.
  static constexpr std::chrono::seconds kQuiet{1};

  /// Lines per second of one client and event, and the size of a burst; 0 means no limit.
  void set_rate(double lines_per_s) { lines_per_s_ = lines_per_s; }

  struct Verdict {
    bool passes = true;
    std::int64_t suppressed = 0;  ///< lines of the event and client since its last line that passed
  };
  [[nodiscard]] Verdict ask(const LogEvent& event, std::string_view client, Time now)
      ABSL_LOCKS_EXCLUDED(mutex_);

  /// Suppressed lines that are not reported yet.
  struct Suppressed {
    LogEvent event;
    std::string client;  ///< empty: of several dropped clients
    std::int64_t lines = 0;
  };
  /// Returns those of clients that were idle for kQuiet.
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
    Time last;  // suppressed
  };
  using EventKey = std::pair<Component, std::string_view>;
  using Key = std::tuple<Component, std::string_view, std::string_view>;  // the client is a Source's own text
  struct Total {
    Bucket bucket;
    Suppressed suppressed;  // of dropped sources
    Time last;
  };
  [[nodiscard]] Source& source_of(const LogEvent& event, std::string_view client, double per_s, Time now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void forget_oldest() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] Total& total_of(const LogEvent& event, double per_s, Time now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  std::atomic<double> lines_per_s_ = 0.0;
  Mutex mutex_;
  std::list<Source> sources_ ABSL_GUARDED_BY(mutex_);  // the most recent one comes first
  std::map<Key, std::list<Source>::iterator> by_key_ ABSL_GUARDED_BY(mutex_);
  std::map<EventKey, Total> totals_ ABSL_GUARDED_BY(mutex_);
  std::int64_t unreported_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::server
