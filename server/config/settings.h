// The server's settings: one table (config.def) defines struct, flags, environment, file and output.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "marble/error.h"

namespace marble::server {

struct Settings {
#define MARBLE_SETTING(type, name, default_value, low, high, unit, doc) type name = default_value;
#define MARBLE_TEXT_SETTING(name, default_value, choices, doc) std::string name = default_value;
#include "config/config.def"
#undef MARBLE_SETTING
#undef MARBLE_TEXT_SETTING
};

/// A setting's value in its own type.
using SettingValue = std::variant<bool, std::int64_t, double, std::string>;

/// Description of one setting.
struct SettingInfo {
  std::string name;
  SettingValue default_value;  ///< also determines the type
  SettingValue low, high;      ///< closed range of a number
  std::string unit, doc;
  std::vector<std::string> choices;  ///< valid texts; empty if any text is valid
};

/// Returns all settings in the order of config.def.
[[nodiscard]] const std::vector<SettingInfo>& setting_table();

/// Sets one setting; checks name, type and range. Accepts an integer for a real number.
[[nodiscard]] Expected<void> set_setting(Settings& settings, std::string_view name,
                                         const SettingValue& value);
/// The same from text, as on a command line.
[[nodiscard]] Expected<void> set_setting_text(Settings& settings, std::string_view name,
                                              const std::string& text);
/// Reads one setting. The name must exist.
[[nodiscard]] SettingValue get_setting(const Settings& settings, std::string_view name);

/// Settings with this prefix apply to each client, and may be set for a single client.
constexpr std::string_view kClientPrefix = "client_";

/// "--queue-jobs" for "queue_jobs".
[[nodiscard]] std::string flag_name(std::string name);
/// "MARBLE_QUEUE_JOBS" for "queue_jobs".
[[nodiscard]] std::string variable_name(std::string name);
/// Returns the value as TOML; numbers have all their digits.
[[nodiscard]] std::string to_toml(const SettingValue& value);
/// "in [0, 1024]", "one of text, json"; empty if every value is valid.
[[nodiscard]] std::string range_of(const SettingInfo& setting);

}  // namespace marble::server
