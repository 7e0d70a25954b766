#include "log/log.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

namespace marble::server {
namespace {

// Text from clients is quoted and escaped, and invalid UTF-8 replaced: no client can forge a line.
void append(std::string& line, const std::string& text) {
  const auto plain = [](char c) { return c >= ' ' && c <= '~' && c != '"' && c != '\\'; };
  if (std::all_of(text.begin(), text.end(), plain)) {
    line.append("\"").append(text).append("\"");
  } else {
    line += nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  }
}

// As in JSON: null for numbers that JSON cannot express.
void append(std::string& line, double number) {
  if (!std::isfinite(number)) {
    line += "null";
    return;
  }
  std::array<char, 32> digits;
  line.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr);
}

void append(std::string& line, std::int64_t number) { line += std::to_string(number); }

}  // namespace

Log::Log(const std::string& format, const std::string& level, std::int64_t queue_bytes)
    : json_(format == "json"),
      writer_(STDERR_FILENO, queue_bytes),
      formatter_(
          json_ ? R"({"time":"%Y-%m-%dT%H:%M:%S.%fZ","level":"%l",%v})" : "%Y-%m-%dT%H:%M:%S.%fZ %l %v",
          spdlog::pattern_time_type::utc) {
  for (auto& of_component : levels_) of_component = spdlog::level::from_str(level);
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
  const auto begin = [&](std::string_view key) {
    text.append(json_ ? ",\"" : " ").append(key).append(json_ ? "\":" : "=");
  };
  for (const Field& field : fields) {
    begin(field.key);
    std::visit([&](const auto& value) { append(text, value); }, field.value);
  }
  if (line.suppressed > 0) {
    begin("suppressed");
    append(text, line.suppressed);
  }
  const MutexLock lock(mutex_);
  const std::int64_t dropped = writer_.backlog().unreported;
  if (dropped > 0) {
    begin("dropped");
    append(text, dropped);
  }
  formatted_.clear();
  formatter_.format(spdlog::details::log_msg("", event.level, text), formatted_);
  writer_.put({formatted_.data(), formatted_.size()}, dropped);
}

void Log::report_suppressed(LogLimit::Time now) {
  const LogWriter::Backlog backlog = writer_.backlog();
  if (backlog.unreported > 0 && !backlog.stalls) warn(Component::server, "dropped", {});
  report(limit_.take_quiet(now));
}

void Log::report_all_suppressed() { report(limit_.take_all()); }

void Log::report(const std::vector<LogLimit::Suppressed>& all) const {
  for (const LogLimit::Suppressed& one : all) {
    Fields fields = {{"of", std::string(one.event.name)}};
    if (!one.client.empty()) fields.push_back({"client", one.client});
    write({{one.event.level, one.event.component, "suppressed"}, one.lines}, fields);
  }
}

}  // namespace marble::server
