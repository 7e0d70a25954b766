// Structured log lines, as text (key=value) or JSON, one event a line.
#pragma once

#include <spdlog/spdlog.h>

#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <variant>

namespace marble::server {

class Log {
 public:
  using Value = std::variant<std::string, std::int64_t, double>;
  struct Field {
    std::string_view key;
    Value value;
  };

  /// `format` is "text" or "json", `level` one of spdlog's names. Lines go to standard error.
  Log(const std::string& format, const std::string& level);

  /// Thread-safe.
  void set_level(const std::string& level) { logger_->set_level(spdlog::level::from_str(level)); }

  void info(std::string_view event, std::initializer_list<Field> fields) const {
    write(spdlog::level::info, event, fields);
  }
  void warn(std::string_view event, std::initializer_list<Field> fields) const {
    write(spdlog::level::warn, event, fields);
  }
  void error(std::string_view event, std::initializer_list<Field> fields) const {
    write(spdlog::level::err, event, fields);
  }

  [[nodiscard]] bool enabled(spdlog::level::level_enum level) const { return logger_->should_log(level); }
  void write(spdlog::level::level_enum level, std::string_view event,
             std::initializer_list<Field> fields) const;

 private:
  std::shared_ptr<spdlog::logger> logger_;
  bool json_;
};

}  // namespace marble::server
