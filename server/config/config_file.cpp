#include "config/config_file.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/text_file.h"
#include "guarded_toml.h"

namespace marble::server {
namespace {

std::optional<SettingValue> value_of(const toml::node& node) {
  if (const auto* truth = node.as_boolean()) return truth->get();
  if (const auto* whole = node.as_integer()) return whole->get();
  if (const auto* real = node.as_floating_point()) return real->get();
  if (const auto* text = node.as_string()) return text->get();
  return std::nullopt;
}

double number_of(const SettingValue& value) {
  if (const auto* truth = std::get_if<bool>(&value)) return *truth ? 1.0 : 0.0;
  if (const auto* whole = std::get_if<std::int64_t>(&value)) return static_cast<double>(*whole);
  return std::get<double>(value);
}

Expected<void> set_solver_option(Options& options, std::string_view name, const SettingValue& value) {
  const auto& table = option_table();
  const auto option = std::find_if(table.begin(), table.end(), [&](const auto& o) { return o.name == name; });
  const auto rule = [&](const char* text) {
    return unexpected(invalid(std::string(name), to_toml(value), text));
  };
  if (const auto* text = std::get_if<std::string>(&value)) {
    if (option != table.end() && option->type != OptionType::choice) return rule("must not be a text");
    return set_option_text(options, name, *text);
  }
  if (option != table.end() && option->type == OptionType::choice) return rule("must be a text");
  const bool truth = std::holds_alternative<bool>(value);
  if (option != table.end() && truth != (option->type == OptionType::boolean))
    return rule(truth ? "must be a number" : "must be true or false");
  return set_option(options, name, number_of(value));
}

class Reader {
 public:
  Reader(const std::string& path, Config& config) : path_(path), config_(config) {}

  void read(const toml::table& root) {
    for (const auto& [key, node] : root) {
      const std::string name(key.str());
      if (name == "listen") {
        read_listen(node, line_of(key));
      } else if (name == "solver") {
        each(node, name, line_of(key),
             [&](const std::string& k, const toml::node& n, Line l) { read_solver_option(k, n, l); });
      } else if (name == "clients") {
        each(node, name, line_of(key),
             [&](const std::string& k, const toml::node& n, Line l) { read_client(k, n, l); });
      } else {
        read_setting(name, node, line_of(key));
      }
    }
  }

  void add_faults(std::vector<ConfigFault>& faults) {
    std::stable_sort(faults_.begin(), faults_.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [line, error] : faults_) faults.push_back({where(line), std::move(error)});
  }

 private:
  using Line = toml::source_index;

  static Line line_of(const toml::key& key) { return key.source().begin.line; }
  [[nodiscard]] std::string where(Line line) const { return path_ + ":" + std::to_string(line); }

  template <class Use>
  void each(const toml::node& node, const std::string& name, Line line, const Use& use) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return refuse(line, invalid(name, "must be a table"));
    for (const auto& [key, value] : *table) use(std::string(key.str()), value, line_of(key));
  }

  void refuse(Line line, Error error) { faults_.emplace_back(line, std::move(error)); }

  /// Records the result of setting `key`.
  void settle(const Expected<void>& outcome, const std::string& key, Line line) {
    if (outcome) {
      config_.sources[key] = where(line);
    } else {
      refuse(line, of_field(key, outcome.error()));
    }
  }

  std::optional<SettingValue> single(const toml::node& node, const std::string& key, Line line) {
    auto value = value_of(node);
    if (!value) refuse(line, invalid(key, "must be a text, a number, true or false"));
    return value;
  }

  void read_setting(const std::string& name, const toml::node& node, Line line) {
    if (const auto known = set_setting(config_, name, get_setting(config_, name)); !known)
      return refuse(line, known.error());
    if (const auto value = single(node, name, line)) settle(set_setting(config_, name, *value), name, line);
  }

  void read_listen(const toml::node& node, Line line) {
    config_.listen.clear();
    config_.sources["listen"] = where(line);
    const auto add = [&](const toml::node& address) {
      const auto* text = address.as_string();
      if (text != nullptr) config_.listen.push_back(text->get());
      return text != nullptr;
    };
    if (add(node)) return;
    const toml::array* addresses = node.as_array();
    const bool texts = addresses != nullptr && std::all_of(addresses->begin(), addresses->end(), add);
    if (!texts) refuse(line, invalid("listen", "must be a text or an array of texts"));
  }

  void read_solver_option(const std::string& name, const toml::node& node, Line line) {
    const std::string key = "solver." + name;
    const auto value = single(node, key, line);
    if (!value) return;
    auto set = set_solver_option(config_.solver_defaults, name, *value);
    if (set && name == "method") set = validate(config_.solver_defaults);
    settle(set, key, line);
  }

  void read_client(const std::string& name, const toml::node& node, Line line) {
    ClientConfig& client = config_.clients[name];
    const std::string prefix = "clients." + name;
    each(node, prefix, line, [&](const std::string& k, const toml::node& n, Line l) {
      read_client_key(client, k, prefix + "." + k, n, l);
    });
  }

  void read_client_key(ClientConfig& client, const std::string& name, const std::string& key,
                       const toml::node& node, Line line) {
    if (name == "roles") return settle(read_roles(client, node), key, line);
    const auto value = single(node, key, line);
    if (!value) return;
    const std::string setting = std::string(kClientPrefix) + name;
    Settings scratch;
    const auto valid = set_setting(scratch, setting, *value);
    settle(valid, key, line);
    if (valid) client.settings[setting] = get_setting(scratch, setting);
  }

  static Expected<void> read_roles(ClientConfig& client, const toml::node& node) {
    const toml::array* names = node.as_array();
    if (names == nullptr) return unexpected(invalid("roles", "must be an array of texts"));
    client.roles.emplace();
    for (const toml::node& element : *names) {
      const auto* text = element.as_string();
      if (text == nullptr) return unexpected(invalid("roles", "must be an array of texts"));
      MARBLE_ASSIGN_OR_RETURN(const auto role, role_of(text->get()));
      client.roles->add(role);
    }
    return {};
  }

  const std::string& path_;
  Config& config_;
  std::vector<std::pair<Line, Error>> faults_;
};

}  // namespace

void read_config_file(const std::string& path, Config& config, std::vector<ConfigFault>& faults) {
  const auto text = read_text_file(path);
  if (!text) {
    Error error = text.error();
    error.value.clear();
    faults.push_back({path, std::move(error)});
    return;
  }
  read_config_text(*text, path, config, faults);
}

void read_config_text(std::string_view text, const std::string& path, Config& config,
                      std::vector<ConfigFault>& faults) {
  const toml::parse_result parsed = toml::parse(text, path);
  if (!parsed) {
    const toml::parse_error& error = parsed.error();
    faults.push_back({path + ":" + std::to_string(error.source().begin.line),
                      invalid("", std::string(error.description()))});
    return;
  }
  Reader reader(path, config);
  reader.read(parsed.table());
  reader.add_faults(faults);
}

}  // namespace marble::server
