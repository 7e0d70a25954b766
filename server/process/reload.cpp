#include "process/reload.h"

#include <set>

namespace marble::server {
namespace {

bool can_change(const std::string& setting) {
  return setting == "tokens" || setting == "log_level" || setting == "log_levels" ||
         setting == "log_lines_per_s" || setting.rfind(kClientPrefix, 0) == 0;
}

struct Difference {
  std::string changed;             ///< keys that were applied, separated by commas
  std::vector<std::string> fixed;  ///< keys that only a restart can change
};

void add(std::string& list, const std::string& key) { list += (list.empty() ? "" : ", ") + key; }

void take_settings(const Config& read, Config& in_force, Difference& difference) {
  for (const SettingInfo& setting : setting_table()) {
    const SettingValue value = get_setting(read, setting.name);
    if (value == get_setting(in_force, setting.name)) continue;
    if (!can_change(setting.name)) {
      difference.fixed.push_back(setting.name);
    } else if (set_setting(in_force, setting.name, value)) {
      add(difference.changed, setting.name);
    }
  }
}

const ClientConfig* find_client(const Config& config, const std::string& name) {
  const auto found = config.clients.find(name);
  return found == config.clients.end() ? nullptr : &found->second;
}

void take_clients(const Config& read, Config& in_force, Difference& difference) {
  std::set<std::string> names;
  for (const auto& [name, client] : read.clients) names.insert(name);
  for (const auto& [name, client] : in_force.clients) names.insert(name);
  for (const std::string& name : names) {
    const ClientConfig* now = find_client(read, name);
    const ClientConfig* before = find_client(in_force, name);
    const bool same = now != nullptr && before != nullptr && *now == *before;
    if (!same) add(difference.changed, "clients." + name);
  }
  in_force.clients = read.clients;
}

void look_at_fixed(const Config& read, const Config& in_force, Difference& difference) {
  if (read.listen != in_force.listen) difference.fixed.emplace_back("listen");
  for (const OptionInfo& option : option_table()) {
    if (get_option(read.solver_defaults, option.name) != get_option(in_force.solver_defaults, option.name))
      difference.fixed.push_back("solver." + std::string(option.name));
  }
}

Difference take(const Config& read, Config& in_force) {
  Difference difference;
  take_settings(read, in_force, difference);
  take_clients(read, in_force, difference);
  if (read.known_tokens != in_force.known_tokens) {
    in_force.known_tokens = read.known_tokens;
    add(difference.changed, "tokens of " + in_force.tokens);
  }
  look_at_fixed(read, in_force, difference);
  return difference;
}

}  // namespace

void configure(Log& log, const Settings& settings) {
  log.configure(*log_levels_of(settings.log_level, settings.log_levels), settings.log_lines_per_s);
}

void Reloader::reload() {
  const auto read = load_config(command_line_);
  if (!read) {
    for (const ConfigFault& fault : read.error())
      log_.error(Component::config, "reload_refused",
                 {{"where", fault.where}, {"reason", fault.error.message()}});
    return;
  }
  Settings next = in_force_;
  next.tokens = read->tokens;
  if (knows_callers(in_force_) && !knows_callers(next)) {
    log_.error(Component::config, "reload_refused",
               {{"where", source_of(in_force_, "tokens")},
                {"reason",
                 "tokens are gone from the configuration, and every caller would have every role: "
                 "that needs a restart"}});
    return;
  }
  const Difference difference = take(*read, in_force_);
  access_.reload(in_force_);
  configure(log_, in_force_);
  for (const std::string& key : difference.fixed)
    log_.warn(Component::config, "needs_restart", {{"setting", key}, {"where", source_of(*read, key)}});
  log_.info(Component::server, "reloaded",
            {{"changed", difference.changed.empty() ? "nothing" : difference.changed}});
}

}  // namespace marble::server
