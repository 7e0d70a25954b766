#include "log.h"

#include <spdlog/sinks/stdout_sinks.h>

#include <nlohmann/json.hpp>

namespace marble::server {

Log::Log(const std::string& format, const std::string& level)
    : logger_(std::make_shared<spdlog::logger>("marble", std::make_shared<spdlog::sinks::stderr_sink_mt>())),
      json_(format == "json") {
  logger_->set_level(spdlog::level::from_str(level));
  logger_->flush_on(spdlog::level::info);
  const auto utc = spdlog::pattern_time_type::utc;
  logger_->set_pattern(
      json_ ? R"({"time":"%Y-%m-%dT%H:%M:%S.%fZ","level":"%l",%v})" : "%Y-%m-%dT%H:%M:%S.%fZ %l %v", utc);
}

void Log::write(spdlog::level::level_enum level, std::string_view event,
                std::initializer_list<Field> fields) const {
  if (!logger_->should_log(level)) return;
  // Text from clients is quoted and escaped, and broken UTF-8 replaced: no client can forge a line.
  const auto quoted = [](const std::string& text) {
    return nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  };
  std::string line = json_ ? "\"event\":" + quoted(std::string(event)) : std::string(event);
  for (const Field& field : fields) {
    const std::string value = std::visit(
        [&](const auto& v) {
          if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::string>) {
            return quoted(v);
          } else {
            return nlohmann::json(v).dump();
          }
        },
        field.value);
    line += json_ ? ",\"" + std::string(field.key) + "\":" : " " + std::string(field.key) + "=";
    line += value;
  }
  logger_->log(level, spdlog::string_view_t(line.data(), line.size()));
}

}  // namespace marble::server
