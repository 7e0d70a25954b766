#include "config/settings.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "plain_text.h"

namespace marble::server {
namespace {

template <class Type>
using Stored = std::conditional_t<std::is_same_v<Type, int>, std::int64_t, Type>;

std::string shown(const SettingValue& value) {
  const auto* text = std::get_if<std::string>(&value);
  return text != nullptr ? *text : to_toml(value);
}

const SettingInfo* find(std::string_view name) {
  const auto& table = setting_table();
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const SettingInfo& info) { return info.name == name; });
  return found == table.end() ? nullptr : &*found;
}

Expected<const SettingInfo*> known(std::string_view name) {
  if (const SettingInfo* info = find(name)) return info;
  return unexpected(invalid(std::string(name), {}, "is not a setting"));
}

std::string type_rule(const SettingInfo& info) {
  switch (info.default_value.index()) {
    case 0:
      return "must be true or false";
    case 1:
      return "must be a whole number";
    case 2:
      return "must be a number";
    default:
      return "must be a text";
  }
}

Expected<SettingValue> checked(const SettingInfo& info, SettingValue value) {
  const auto refused = [&](std::string rule) {
    return unexpected(invalid(info.name, shown(value), std::move(rule)));
  };
  if (const auto* whole = std::get_if<std::int64_t>(&value);
      whole != nullptr && std::holds_alternative<double>(info.default_value)) {
    value = static_cast<double>(*whole);
  }
  if (value.index() != info.default_value.index()) return refused(type_rule(info));
  if (const auto* text = std::get_if<std::string>(&value)) {
    const bool allowed = info.choices.empty() ||
                         std::find(info.choices.begin(), info.choices.end(), *text) != info.choices.end();
    if (!allowed) return refused("must be " + range_of(info));
    if (text->find('\0') != std::string::npos) return refused("must have no zero byte");
  } else if (!(value >= info.low && value <= info.high)) {  // also catches NaN
    return refused("must be " + range_of(info));
  }
  return value;
}

template <class Type>
void assign(Type& member, const SettingValue& value) {
  member = static_cast<Type>(std::get<Stored<Type>>(value));
}

template <class Number>
Expected<SettingValue> number_of(const SettingInfo& info, const std::string& text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc::invalid_argument || end != text.data() + text.size()) {
    return unexpected(invalid(info.name, text.empty() ? "\"\"" : text, type_rule(info)));
  }
  if (error == std::errc::result_out_of_range)
    return unexpected(invalid(info.name, text, "must be " + range_of(info)));
  return number;
}

Expected<SettingValue> value_of(const SettingInfo& info, const std::string& text) {
  switch (info.default_value.index()) {
    case 0:
      if (text == "true" || text == "1") return true;
      if (text == "false" || text == "0") return false;
      return unexpected(invalid(info.name, text, type_rule(info)));
    case 1:
      return number_of<std::int64_t>(info, text);
    case 2:
      return number_of<double>(info, text);
    default:
      return text;
  }
}

}  // namespace

const std::vector<SettingInfo>& setting_table() {
  static const std::vector<SettingInfo> table = {
#define MARBLE_SETTING(type, name, default_value, low, high, unit, doc) \
  {#name, Stored<type>(default_value), Stored<type>(low), Stored<type>(high), unit, doc, {}},
#define MARBLE_TEXT_SETTING(name, default_value, choices, doc) \
  {#name, std::string(default_value), std::string(), std::string(), "", doc, choices},
#include "config/config.def"
#undef MARBLE_SETTING
#undef MARBLE_TEXT_SETTING
  };
  return table;
}

Expected<void> set_setting(Settings& settings, std::string_view name, const SettingValue& value) {
  MARBLE_ASSIGN_OR_RETURN(const auto info, known(name));
  MARBLE_ASSIGN_OR_RETURN(auto valid, checked(*info, value));
#define MARBLE_SETTING(type, member, default_value, low, high, unit, doc) \
  if (name == #member) assign(settings.member, valid);
#define MARBLE_TEXT_SETTING(member, default_value, choices, doc) \
  if (name == #member) assign(settings.member, valid);
#include "config/config.def"
#undef MARBLE_SETTING
#undef MARBLE_TEXT_SETTING
  return {};
}

Expected<void> set_setting_text(Settings& settings, std::string_view name, const std::string& text) {
  MARBLE_ASSIGN_OR_RETURN(const auto info, known(name));
  MARBLE_ASSIGN_OR_RETURN(const auto value, value_of(*info, text));
  return set_setting(settings, name, value);
}

SettingValue get_setting(const Settings& settings, std::string_view name) {
#define MARBLE_SETTING(type, member, default_value, low, high, unit, doc) \
  if (name == #member) return Stored<type>(settings.member);
#define MARBLE_TEXT_SETTING(member, default_value, choices, doc) \
  if (name == #member) return settings.member;
#include "config/config.def"
#undef MARBLE_SETTING
#undef MARBLE_TEXT_SETTING
  return false;
}

std::string flag_name(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return "--" + name;
}

std::string variable_name(std::string name) {
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::toupper(c); });
  return "MARBLE_" + name;
}

std::string to_toml(const SettingValue& value) {
  if (const auto* real = std::get_if<double>(&value); real != nullptr && !std::isfinite(*real))
    return std::isnan(*real) ? "nan" : *real > 0.0 ? "inf" : "-inf";
  return std::visit(
      [](const auto& v) {  // TOML writes numbers, booleans and escapes as JSON does
        return with_escaped_controls(
            nlohmann::json(v).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
      },
      value);
}

std::string range_of(const SettingInfo& setting) {
  std::string text;
  for (const std::string& choice : setting.choices) text += (text.empty() ? "one of " : ", ") + choice;
  const auto type = setting.default_value.index();
  if (type == 1 || type == 2) text = "in [" + to_toml(setting.low) + ", " + to_toml(setting.high) + "]";
  return text;
}

}  // namespace marble::server
