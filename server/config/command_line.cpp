#include "config/command_line.h"

#include <CLI/CLI.hpp>

#include "config/settings.h"
#include "marble/contract.h"
#include "marble/version.h"

namespace marble::server {
namespace {

std::string type_name(const SettingInfo& setting) {
  constexpr const char* kNames[] = {"", "INT", "FLOAT", "TEXT"};
  const std::string range = range_of(setting);
  return kNames[setting.default_value.index()] + (range.empty() ? "" : " " + range);
}

void add_setting(CLI::App& app, const SettingInfo& setting, CommandLine& result) {
  std::string& given = result.settings[setting.name];
  const std::string unit = setting.unit.empty() ? "" : " (" + setting.unit + ")";
  const std::string text = setting.doc + unit + " [" + variable_name(setting.name) + "]";
  if (std::holds_alternative<bool>(setting.default_value)) {
    app.add_flag(flag_name(setting.name), given, text);
  } else {
    const auto* words = std::get_if<std::string>(&setting.default_value);
    app.add_option(flag_name(setting.name), given, text)
        ->type_name(type_name(setting))
        ->default_str(words != nullptr ? *words : to_toml(setting.default_value));
  }
}

}  // namespace

std::optional<CommandLine> parse_command_line(int argc, const char* const* argv, int& exit_code) {
  CommandLine result;
  CLI::App app("Marble server: solves quadratic programs with complementarity constraints over gRPC.",
               "marble-server");
  app.set_version_flag("--version", std::string("marble-server ") + kVersion);
  app.get_formatter()->column_width(44);
  app.add_option(
      "--config", result.config_file,
      "TOML file of settings, under their names with underscores; flags and environment override it "
      "[MARBLE_CONFIG]");
  app.add_flag("--print-config", result.print_config,
               "Print every setting in force and its source, as a TOML file, and exit");
  app.add_flag("--check-config", result.check_config,
               "Check the configuration, the token file and the certificates, and exit");
  app.add_flag(
      "--check-state", result.check_state,
      "Check the whole file of state_dir or the tables of state, print the number of their jobs, and exit; "
      "also works while a server uses them");
  app.add_flag("--print-metrics", result.print_metrics,
               "Print every metric of /metrics, as a Markdown table, and exit");
  app.add_option("--new-token", result.new_token,
                 "Print a new token for a client with these roles and its line for the token file, and exit")
      ->type_name("NAME:ROLE[,ROLE...]");
  app.add_option("--listen", result.listen,
                 "Address to listen on: HOST:PORT (port 0 takes a free one) or unix:PATH; "
                 "can be given several times [MARBLE_LISTEN]")
      ->delimiter(',')
      ->default_str(contract::default_address);
  for (const SettingInfo& setting : setting_table()) add_setting(app, setting, result);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    exit_code = app.exit(error) == 0 ? 0 : 2;
    return std::nullopt;
  }
  for (const SettingInfo& setting : setting_table()) {
    if (app.count(flag_name(setting.name)) == 0) result.settings.erase(setting.name);
  }
  if (const char* file = std::getenv("MARBLE_CONFIG"); file != nullptr && app.count("--config") == 0)
    result.config_file = file;
  return result;
}

}  // namespace marble::server
