// The server's configuration: settings and tables, from flags, environment and file.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/identity.h"
#include "base/tokens.h"
#include "config/command_line.h"
#include "config/settings.h"
#include "marble/contract.h"
#include "marble/options.h"

namespace marble::server {

/// The file's table [clients.NAME] for one client.
struct ClientConfig {
  std::map<std::string, SettingValue>
      settings;  ///< its own values of client_ settings, by the setting's name
  std::optional<Roles> roles;
  [[nodiscard]] bool operator==(const ClientConfig&) const = default;
};

struct Config : Settings {
  std::vector<std::string> listen = {
      contract::default_address};  ///< host:port, with port 0 for any free port, or unix:PATH
  Options solver_defaults;         ///< defaults of options that a request leaves out
  std::map<std::string, ClientConfig> clients;
  std::vector<Token> known_tokens;             ///< contents of the file `tokens`
  std::map<std::string, std::string> sources;  ///< source of each key that is not at its default
};

/// One error in the configuration.
struct ConfigFault {
  std::string where;  ///< "FILE:LINE", "environment MARBLE_X" or "flag --x"
  Error error;
  [[nodiscard]] std::string message() const { return where + ": " + error.message(); }
};

/// Returns the effective configuration, or all its errors. A flag takes precedence over the environment, then
/// the file, then the default. Reads the files that it names too: an invalid token file or certificate is an
/// error.
[[nodiscard]] tl::expected<Config, std::vector<ConfigFault>> load_config(const CommandLine& command_line);

/// Returns the source of the key's value: "default", "FILE:LINE", "environment MARBLE_X" or "flag --x".
[[nodiscard]] std::string source_of(const Config& config, const std::string& key);

/// Returns the whole configuration as TOML, each value with a comment that names its source.
[[nodiscard]] std::string to_toml(const Config& config);

/// True if callers are identified by tokens or certificates, not by the names they give: else each has every
/// role.
[[nodiscard]] bool knows_callers(const Settings& settings);
/// Returns the addresses that other machines can reach.
[[nodiscard]] std::vector<std::string> addresses_beyond_loopback(const Config& config);

/// The meaning of "auto" for the HTTP port.
inline const std::string kDefaultHttpAddress = "127.0.0.1:50080";

/// True if only this machine can reach the address: loopback, or a unix socket.
[[nodiscard]] bool is_local_address(const std::string& address);
/// True for unix sockets, which do not use TLS.
[[nodiscard]] bool is_unix_address(const std::string& address);

}  // namespace marble::server
