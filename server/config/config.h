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

/// What the file's table [clients.NAME] says of one client.
struct ClientConfig {
  std::map<std::string, SettingValue>
      settings;  ///< its own values of client_ settings, by the setting's name
  std::optional<Roles> roles;
  [[nodiscard]] bool operator==(const ClientConfig&) const = default;
};

struct Config : Settings {
  std::vector<std::string> listen = {
      contract::default_address};  ///< host:port, port 0 for a free one, or unix:PATH
  Options solver_defaults;         ///< of options that a request leaves out
  std::map<std::string, ClientConfig> clients;
  std::vector<Token> known_tokens;             ///< what the file `tokens` holds
  std::map<std::string, std::string> sources;  ///< of keys that are not at their default: where from
};

/// One thing that is wrong with the configuration.
struct ConfigFault {
  std::string where;  ///< "FILE:LINE", "environment MARBLE_X" or "flag --x"
  Error error;
  [[nodiscard]] std::string message() const { return where + ": " + error.message(); }
};

/// Everything in force, flag over environment over file over default, or all that is wrong with it. Reads the
/// files it names too: a token file or a certificate that is no good is a fault.
[[nodiscard]] tl::expected<Config, std::vector<ConfigFault>> load_config(const CommandLine& command_line);

/// Where the key's value came from: "default", "FILE:LINE", "environment MARBLE_X" or "flag --x".
[[nodiscard]] std::string source_of(const Config& config, const std::string& key);

/// All of it as TOML, each value with a comment that says where it came from.
[[nodiscard]] std::string to_toml(const Config& config);

/// Whether callers are told apart by tokens or certificates, not by what they say: else each has every role.
[[nodiscard]] bool knows_callers(const Settings& settings);
/// Of all addresses, those that others than this machine can reach.
[[nodiscard]] std::vector<std::string> addresses_beyond_loopback(const Config& config);

/// What "auto" means for the HTTP port.
inline const std::string kDefaultHttpAddress = "127.0.0.1:50080";

/// True if only this machine can reach the address: loopback, or a unix socket.
[[nodiscard]] bool is_local_address(const std::string& address);
/// True for unix sockets, which stay without TLS.
[[nodiscard]] bool is_unix_address(const std::string& address);

}  // namespace marble::server
