#include "config/config.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <sstream>
#include <string_view>

#include "base/libpq.h"
#include "base/page_url.h"
#include "base/text_file.h"
#include "config/certificates.h"
#include "config/config_file.h"
#include "log/log_levels.h"

namespace marble::server {
namespace {

using Faults = std::vector<ConfigFault>;

std::optional<std::string> variable(const std::string& name) {
  const char* value = std::getenv(variable_name(name).c_str());
  if (value == nullptr || *value == '\0') return std::nullopt;
  return value;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  return parts;
}

void set(Config& config, const std::string& name, const std::string& text, const std::string& source,
         Faults& faults) {
  if (const auto valid = set_setting_text(config, name, text)) {
    config.sources[name] = source;
  } else {
    faults.push_back({source, valid.error()});
  }
}

void read_environment(Config& config, Faults& faults) {
  for (const SettingInfo& setting : setting_table()) {
    if (const auto text = variable(setting.name))
      set(config, setting.name, *text, "environment " + variable_name(setting.name), faults);
  }
  if (const auto text = variable("listen")) {
    config.listen = split(*text);
    config.sources["listen"] = "environment MARBLE_LISTEN";
  }
}

void read_flags(const CommandLine& command_line, Config& config, Faults& faults) {
  for (const auto& [name, text] : command_line.settings)
    set(config, name, text, "flag " + flag_name(name), faults);
  if (!command_line.listen.empty()) {
    config.listen = command_line.listen;
    config.sources["listen"] = "flag --listen";
  }
}

bool is_host_and_port(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  const std::string port = address.substr(colon + 1);
  return !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos &&
         std::stoi(port) <= 65535;
}

void check_addresses(const Config& config, Faults& faults) {
  const auto fault = [&](const std::string& field, const std::string& address, const std::string& rule) {
    faults.push_back({source_of(config, field), invalid(field, address, rule)});
  };
  const auto check = [&](const std::string& field, const std::string& address) {
    if (is_local_address(address)) return;
    if (config.tls_certificate.empty() && !config.insecure) {
      fault(field, address,
            "is reachable from other machines and connections are not encrypted; give tls_certificate and "
            "tls_key, or add --insecure if that is what you want");
    }
    if (!knows_callers(config) && !config.allow_anonymous) {
      fault(field, address,
            "is reachable from other machines and every caller has every role; give tokens or tls_client_ca, "
            "or add --allow-anonymous if that is what you want");
    }
  };
  if (config.listen.empty()) fault("listen", "", "must have an address");
  for (const std::string& address : config.listen) check("listen", address);
  if (config.http == "auto" || config.http == "none") return;
  if (is_host_and_port(config.http)) {
    check("http", config.http);
  } else {
    fault("http", config.http, "must be HOST:PORT with a port in [0, 65535], auto or none");
  }
}

void read_tokens(Config& config, Faults& faults) {
  if (config.tokens.empty()) return;
  const auto text = read_text_file(config.tokens);
  if (!text) {
    faults.push_back({source_of(config, "tokens"), of_field("tokens", text.error())});
    return;
  }
  std::vector<LineFault> wrong;
  config.known_tokens = parse_tokens(*text, wrong);
  for (LineFault& fault : wrong)
    faults.push_back({config.tokens + ":" + std::to_string(fault.line), std::move(fault.error)});
}

void check_certificates(const Config& config, Faults& faults) {
  for (Error& error : faults_of_tls(config)) {
    std::string where = source_of(config, error.field);
    faults.push_back({std::move(where), std::move(error)});
  }
}

void check_log_levels(const Config& config, Faults& faults) {
  if (const auto levels = log_levels_of(config.log_level, config.log_levels); !levels)
    faults.push_back({source_of(config, "log_levels"), levels.error()});
}

// Of libpq.
struct FreeOptions {
  void operator()(PQconninfoOption* options) const { libpq().PQconninfoFree(options); }
};

// Refuses what is not a URI of PostgreSQL, and one that contains a password, which others could see. No error
// contains the value, for the same reason.
Expected<void> check_state_uri(const std::string& uri) {
  if (!uri.starts_with("postgresql://")) return unexpected(invalid("state", "must begin with postgresql://"));
  if (!libpq().loaded) return libpq().loaded;
  char* why = nullptr;
  const std::unique_ptr<PQconninfoOption, FreeOptions> options(libpq().PQconninfoParse(uri.c_str(), &why));
  libpq().PQfreemem(why);
  if (options == nullptr) return unexpected(invalid("state", "is no address of PostgreSQL"));
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val == nullptr || std::string_view(option->dispchar) != "*")
      continue;  // libpq's mark of a secret
    const std::string name = option->keyword;
    return unexpected(invalid(
        "state", "must hold no " + name +
                     (name == "password" ? ": give it by PGPASSWORD, or in the file of passfile="
                                         : ": use a key file without one that only the server can read")));
  }
  return {};
}

void check_state(const Config& config, Faults& faults) {
  if (config.state.empty()) return;
  if (auto valid = check_state_uri(config.state); !valid)
    faults.push_back({source_of(config, "state"), valid.error()});
  if (!config.state_dir.empty())
    faults.push_back({source_of(config, "state"), invalid("state", "must not be set beside state_dir")});
}

void check_public_url(const Config& config, Faults& faults) {
  if (config.public_url.empty() || !checked_page(config.public_url).empty()) return;
  faults.push_back(
      {source_of(config, "public_url"),
       invalid("public_url", config.public_url,
               "must be http://HOST:PORT or https://HOST:PORT, without user and path, of at most " +
                   std::to_string(kLongestPageUrl) + " characters")});
}

}  // namespace

tl::expected<Config, std::vector<ConfigFault>> load_config(const CommandLine& command_line) {
  Config config;
  Faults faults;
  if (!command_line.config_file.empty()) read_config_file(command_line.config_file, config, faults);
  read_environment(config, faults);
  read_flags(command_line, config, faults);
  check_addresses(config, faults);
  read_tokens(config, faults);
  check_certificates(config, faults);
  check_log_levels(config, faults);
  check_state(config, faults);
  check_public_url(config, faults);
  if (!faults.empty()) return unexpected(std::move(faults));
  return config;
}

std::string source_of(const Config& config, const std::string& key) {
  const auto found = config.sources.find(key);
  return found == config.sources.end() ? "default" : found->second;
}

bool knows_callers(const Settings& settings) {
  return !settings.tokens.empty() || client_certificate_of(settings) != ClientCertificate::none;
}

std::vector<std::string> addresses_beyond_loopback(const Config& config) {
  std::vector<std::string> addresses = config.listen;
  if (config.http != "auto" && config.http != "none") addresses.push_back(config.http);
  addresses.erase(std::remove_if(addresses.begin(), addresses.end(), is_local_address), addresses.end());
  return addresses;
}

bool is_unix_address(const std::string& address) {
  return address.rfind("unix:", 0) == 0 || address.rfind("unix-abstract:", 0) == 0;
}

bool is_local_address(const std::string& address) {
  if (is_unix_address(address)) return true;
  const std::string host = address.substr(0, address.rfind(':'));
  const auto all_of = [](const std::string& text, const char* allowed) {
    return text.find_first_not_of(allowed) == std::string::npos;
  };
  return host == "localhost" || host == "[::1]" ||
         (host.rfind("127.", 0) == 0 && all_of(host, "0123456789."));
}

}  // namespace marble::server
