// Structured log lines, as text (key=value) or JSON, one event a line.
#pragma once

#include <spdlog/spdlog.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "log_levels.h"
#include "log_limit.h"

namespace marble::server {

/// Thread-safe. A line below its component's level, or beyond what its client may log, costs no more than
/// finding that out: ask for it, and make its fields only if it is given.
class Log {
 public:
  using Value = std::variant<std::string, std::int64_t, double>;
  struct Field {
    std::string_view key;
    Value value;
  };
  using Fields = std::vector<Field>;

  /// A line that is to be written.
  struct Line {
    LogEvent event;
    std::int64_t suppressed = 0;  ///< lines like it that were held back before it
  };

  /// `format` is "text" or "json", `level` one of log_level's, for all components. Lines go to standard
  /// error.
  Log(const std::string& format, const std::string& level);

  /// From now on. A client's lines of one event are limited to `lines_per_s`; 0 is no limit.
  void configure(const LogLevels& levels, double lines_per_s);

  [[nodiscard]] bool enabled(LogLevel level, Component component) const {
    return level >= levels_[static_cast<std::size_t>(component)].load(std::memory_order_relaxed);
  }

  /// The line, if its level is on.
  [[nodiscard]] std::optional<Line> line(const LogEvent& event) const;
  /// The same for what a client can cause as often as it likes: nothing beyond its share. Errors always pass.
  [[nodiscard]] std::optional<Line> line(const LogEvent& event, std::string_view client) const;
  void write(const Line& line, const Fields& fields) const;

  void info(Component component, const char* event, const Fields& fields) const {
    write_if({spdlog::level::info, component, event}, fields);
  }
  void warn(Component component, const char* event, const Fields& fields) const {
    write_if({spdlog::level::warn, component, event}, fields);
  }
  void error(Component component, const char* event, const Fields& fields) const {
    write_if({spdlog::level::err, component, event}, fields);
  }

  /// Tells how many lines were held back of clients that are silent now; at the end, of all.
  void tell_suppressed(LogLimit::Time now);
  void tell_all_suppressed();

 private:
  void write_if(const LogEvent& event, const Fields& fields) const {
    if (const auto passing = line(event)) write(*passing, fields);
  }
  void tell(const std::vector<LogLimit::Suppressed>& all) const;

  std::shared_ptr<spdlog::logger> logger_;
  bool json_;
  std::array<std::atomic<LogLevel>, kComponentNames.size()> levels_;
  mutable LogLimit limit_;
};

}  // namespace marble::server
