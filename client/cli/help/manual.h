// Manual pages, from the same tree as the program's help.
#pragma once

#include <string>
#include <vector>

#include "help/command_tree.h"

namespace marble::cli {

/// The page of the program, marble(1), of commands as command_tree returns them, in roff.
[[nodiscard]] std::string program_page(const std::vector<Command>& commands);

/// The page of a command, such as marble-solve(1).
[[nodiscard]] std::string command_page(const Command& command);

}  // namespace marble::cli
