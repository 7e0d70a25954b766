#include "log.h"

#include <spdlog/sinks/stdout_sinks.h>

#include <nlohmann/json.hpp>

namespace marble::server {
namespace {

// Text from clients is quoted and escaped, and broken UTF-8 replaced: no client can forge a line.
std::string shown(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}
std::string shown(std::int64_t number) { return std::to_string(number); }
std::string shown(double number) { return nlohmann::json(number).dump(); }

}  // namespace

Log::Log(const std::string& format, const std::string& level)
    : logger_(std::make_shared<spdlog::logger>("marble", std::make_shared<spdlog::sinks::stderr_sink_mt>())),
      json_(format == "json") {
  for (auto& of_component : levels_) of_component = spdlog::level::from_str(level);
  logger_->set_level(spdlog::level::trace);  // the components have their own
  logger_->flush_on(spdlog::level::info);
  const auto utc = spdlog::pattern_time_type::utc;
  logger_->set_pattern(
      json_ ? R"({"time":"%Y-%m-%dT%H:%M:%S.%fZ","level":"%l",%v})" : "%Y-%m-%dT%H:%M:%S.%fZ %l %v", utc);
}

void Log::configure(const LogLevels& levels, double lines_per_s) {
  for (std::size_t i = 0; i < levels.size(); ++i) levels_[i] = levels[i];
  limit_.set_rate(lines_per_s);
}

std::optional<Log::Line> Log::line(const LogEvent& event) const {
  if (!enabled(event.level, event.component)) return std::nullopt;
  return Line{event};
}

std::optional<Log::Line> Log::line(const LogEvent& event, std::string_view client) const {
  if (!enabled(event.level, event.component)) return std::nullopt;
  if (event.level >= spdlog::level::err) return Line{event};
  const auto verdict = limit_.ask(event, client, std::chrono::steady_clock::now());
  if (!verdict.passes) return std::nullopt;
  return Line{event, verdict.suppressed};
}

void Log::write(const Line& line, const Fields& fields) const {
  const LogEvent& event = line.event;
  std::string text = json_ ? "\"event\":\"" : "";
  text.append(event.name).append(json_ ? R"(","component":")" : " component=");
  text.append(to_string(event.component)).append(json_ ? "\"" : "");
  const auto add = [&](std::string_view key, const std::string& value) {
    text.append(json_ ? ",\"" : " ").append(key).append(json_ ? "\":" : "=").append(value);
  };
  for (const Field& field : fields)
    add(field.key, std::visit([](const auto& value) { return shown(value); }, field.value));
  if (line.suppressed > 0) add("suppressed", shown(line.suppressed));
  logger_->log(event.level, spdlog::string_view_t(text.data(), text.size()));
}

void Log::tell_suppressed(LogLimit::Time now) { tell(limit_.take_quiet(now)); }

void Log::tell_all_suppressed() { tell(limit_.take_all()); }

void Log::tell(const std::vector<LogLimit::Suppressed>& all) const {
  for (const LogLimit::Suppressed& one : all) {
    Fields fields = {{"of", std::string(one.event.name)}};
    if (!one.client.empty()) fields.push_back({"client", one.client});
    write({{one.event.level, one.event.component, "suppressed"}, one.lines}, fields);
  }
}

}  // namespace marble::server
