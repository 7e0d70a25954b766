#include "marble/version.h"

#include <iostream>

#include "base/exit_code.h"
#include "commands/commands.h"

namespace marble::cli {

void add_version(CLI::App& program, int& exit_code) {
  const std::string text = std::string("marble ") + kVersion;
  program.set_version_flag("--version", text);
  program.add_subcommand("version", "Print the version of this program")->callback([text, &exit_code] {
    std::cout << text << '\n';
    exit_code = kAllSolved;
  });
}

}  // namespace marble::cli
