// The command line as given; config.h turns it into settings.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace marble::server {

struct CommandLine {
  std::string config_file;                      ///< --config or MARBLE_CONFIG; empty if there is none
  std::map<std::string, std::string> settings;  ///< the settings given, by name
  std::vector<std::string> listen;              ///< empty if not given
  bool print_config = false;
  bool check_config = false;
  bool print_metrics = false;
  bool check_state = false;
  std::string new_token;  ///< NAME:ROLES; empty if no token is requested
};

/// If the process must exit instead (help, version, an error), prints the reason and sets `exit_code`.
[[nodiscard]] std::optional<CommandLine> parse_command_line(int argc, const char* const* argv,
                                                            int& exit_code);

}  // namespace marble::server
