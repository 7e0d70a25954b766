// Scripts by which shells complete the program's commands and arguments.
#pragma once

#include <string>
#include <vector>

#include "help/command_tree.h"

namespace marble::cli {

/// The script for bash, of commands as command_tree returns them; solver_options: what --option may begin
/// with.
[[nodiscard]] std::string bash_completion(const std::vector<Command>& commands,
                                          const std::vector<std::string>& solver_options);
[[nodiscard]] std::string zsh_completion(const std::vector<Command>& commands,
                                         const std::vector<std::string>& solver_options);
[[nodiscard]] std::string fish_completion(const std::vector<Command>& commands,
                                          const std::vector<std::string>& solver_options);

}  // namespace marble::cli
