#include "log/log_levels.h"

#include <algorithm>
#include <optional>
#include <set>

namespace marble::server {
namespace {

constexpr std::array<const char*, 5> kLevelNames = {"debug", "info", "warn", "error", "off"};

template <std::size_t size>
std::string one_of(const std::array<const char*, size>& names) {
  std::string text;
  for (const char* name : names) text += (text.empty() ? "must be one of " : ", ") + std::string(name);
  return text;
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(' ');
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

Expected<void> set_one(const std::string& part, std::set<std::string>& reported, LogLevels& levels) {
  const auto refused = [](const std::string& value, std::string bound) {
    return unexpected(invalid("log_levels", value, std::move(bound)));
  };
  const std::size_t equals = part.find('=');
  if (equals == std::string::npos) return refused(part, "must be COMPONENT=LEVEL");
  const std::string name = trimmed(part.substr(0, equals));
  const std::string level = trimmed(part.substr(equals + 1));
  const auto* component = std::find(kComponentNames.begin(), kComponentNames.end(), name);
  if (component == kComponentNames.end()) return refused(name, one_of(kComponentNames));
  if (std::find(kLevelNames.begin(), kLevelNames.end(), level) == kLevelNames.end())
    return refused(name + "=" + level, one_of(kLevelNames));
  if (!reported.insert(name).second) return refused(name, "must be given once");
  levels[static_cast<std::size_t>(component - kComponentNames.begin())] = spdlog::level::from_str(level);
  return {};
}

}  // namespace

Expected<LogLevels> log_levels_of(const std::string& level, const std::string& overrides) {
  LogLevels levels;
  levels.fill(spdlog::level::from_str(level));
  if (trimmed(overrides).empty()) return levels;
  std::set<std::string> reported;
  std::size_t begin = 0;
  for (std::size_t end = 0; end != std::string::npos; begin = end + 1) {
    end = overrides.find(',', begin);
    const auto length = end == std::string::npos ? end : end - begin;
    MARBLE_RETURN_IF_ERROR(set_one(trimmed(overrides.substr(begin, length)), reported, levels));
  }
  return levels;
}

}  // namespace marble::server
