// Structured log lines, as text (key=value) or JSON, one event per line.
#pragma once

#include <spdlog/pattern_formatter.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "log/log_levels.h"
#include "log/log_limit.h"
#include "log/log_writer.h"
#include "mutex.h"

namespace marble::server {

/// Thread-safe. A line below its component's level, or beyond its client's limit, costs only this check:
/// request the line first, and make its fields only if it is returned.
class Log {
 public:
  using Value = std::variant<std::string, std::int64_t, double>;
  struct Field {
    std::string_view key;
    Value value;
  };
  using Fields = std::vector<Field>;

  /// A line that must be written.
  struct Line {
    LogEvent event;
    std::int64_t suppressed = 0;  ///< similar lines that were suppressed before it
  };

  /// `format` is "text" or "json", `level` one of log_level's, for all components. Lines go to standard
  /// error; a reader that is behind by `queue_bytes` misses some, which are counted: no thread waits for it.
  Log(const std::string& format, const std::string& level, std::int64_t queue_bytes);

  /// Applies from now on. A client's lines of one event are limited to `lines_per_s`; 0 means no limit.
  void configure(const LogLevels& levels, double lines_per_s);

  [[nodiscard]] bool enabled(LogLevel level, Component component) const {
    return level >= levels_[static_cast<std::size_t>(component)].load(std::memory_order_relaxed);
  }

  /// Returns the line, if its level is on.
  [[nodiscard]] std::optional<Line> line(const LogEvent& event) const;
  /// The same for events that a client can cause at any rate: empty beyond its limit. Errors always pass.
  [[nodiscard]] std::optional<Line> line(const LogEvent& event, std::string_view client) const;
  void write(const Line& line, const Fields& fields) const ABSL_LOCKS_EXCLUDED(mutex_);

  void info(Component component, const char* event, const Fields& fields) const {
    write_if({spdlog::level::info, component, event}, fields);
  }
  void warn(Component component, const char* event, const Fields& fields) const {
    write_if({spdlog::level::warn, component, event}, fields);
  }
  void error(Component component, const char* event, const Fields& fields) const {
    write_if({spdlog::level::err, component, event}, fields);
  }

  /// Number of lines that the reader has missed.
  [[nodiscard]] std::int64_t dropped() const { return writer_.dropped(); }

  /// Logs how many lines the reader has missed, once it keeps up, and how many were suppressed for clients
  /// that are idle now; at the end, for all.
  void report_suppressed(LogLimit::Time now);
  void report_all_suppressed();

 private:
  void write_if(const LogEvent& event, const Fields& fields) const {
    if (const auto passing = line(event)) write(*passing, fields);
  }
  void report(const std::vector<LogLimit::Suppressed>& all) const;

  const bool json_;
  std::array<std::atomic<LogLevel>, kComponentNames.size()> levels_;
  mutable LogLimit limit_;
  mutable LogWriter writer_;
  mutable Mutex mutex_;  // keeps lines in the order of their times
  mutable spdlog::pattern_formatter formatter_ ABSL_GUARDED_BY(mutex_);
  mutable spdlog::memory_buf_t formatted_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
