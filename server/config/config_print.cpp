// Writes the configuration as a TOML file.
#include <cstddef>

#include "config/config.h"

namespace marble::server {
namespace {

class Printer {
 public:
  explicit Printer(const Config& config) : config_(config) {}

  void table(const std::string& name) { text_ += "\n[" + name + "]\n"; }
  void line(const std::string& name, const std::string& value, const std::string& key) {
    text_.append(name).append(" = ").append(value).append("  # ").append(source_of(config_, key)) += '\n';
  }
  [[nodiscard]] std::string text() && { return std::move(text_); }

 private:
  const Config& config_;
  std::string text_;
};

std::string array(const std::vector<std::string>& texts) {
  std::string result;
  for (const std::string& text : texts) result += (result.empty() ? "" : ", ") + to_toml(SettingValue(text));
  return "[" + result + "]";
}

std::string value_of(const Options& options, const OptionInfo& option) {
  const double value = get_option(options, option.name);
  switch (option.type) {
    case OptionType::choice:
      return to_toml(SettingValue(std::string(option.choices[static_cast<std::size_t>(value)])));
    case OptionType::boolean:
      return to_toml(SettingValue(value != 0.0));
    case OptionType::integer:
      return to_toml(SettingValue(static_cast<std::int64_t>(value)));
    case OptionType::real:
      break;
  }
  return to_toml(SettingValue(value));
}

}  // namespace

std::string to_toml(const Config& config) {
  Printer printer(config);
  printer.line("listen", array(config.listen), "listen");
  for (const SettingInfo& setting : setting_table())
    printer.line(setting.name, to_toml(get_setting(config, setting.name)), setting.name);
  printer.table("solver");
  for (const OptionInfo& option : option_table()) {
    const std::string name(option.name);
    printer.line(name, value_of(config.solver_defaults, option), "solver." + name);
  }
  for (const auto& [name, client] : config.clients) {
    const std::string prefix = "clients." + name + ".";
    printer.table("clients." + to_toml(SettingValue(name)));
    for (const auto& [setting, value] : client.settings) {
      const std::string key = setting.substr(kClientPrefix.size());
      printer.line(key, to_toml(value), prefix + key);
    }
    if (client.roles) printer.line("roles", array(client.roles->names()), prefix + "roles");
  }
  return std::move(printer).text();
}

}  // namespace marble::server
