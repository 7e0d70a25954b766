#include "help/completion.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "help/manual.h"

namespace marble::cli {
namespace {

int write_pages(const std::vector<Command>& commands, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  for (const Command& command : commands) {
    const bool whole = &command == &commands.front();
    const std::string path = folder + (whole ? "/marble.1" : "/marble-" + command.name + ".1");
    std::ofstream stream(path, std::ios::binary);
    stream << (whole ? program_page(commands) : command_page(command));
    stream.close();
    if (!stream) {
      complain(path, "cannot be written");
      return kBadInput;
    }
  }
  return kAllSolved;
}

}  // namespace

void add_completion(CLI::App& program, int& exit_code) {
  const auto shell = std::make_shared<std::string>();
  CLI::App* command =
      program.add_subcommand("completion", "Print a script that completes commands and options in a shell");
  command->add_option("SHELL", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->footer(
      "bash: source <(marble completion bash), or into /usr/share/bash-completion/completions/marble.\n"
      "zsh: into a file _marble in a folder of $fpath.\n"
      "fish: into ~/.config/fish/completions/marble.fish.\n"
      "Packages have these files.");
  command->callback([&program, shell, &exit_code] {
    const auto script = *shell == "bash"  ? bash_completion
                        : *shell == "zsh" ? zsh_completion
                                          : fish_completion;
    std::cout << script(command_tree(program), solver_option_names());
    exit_code = kAllSolved;
  });
}

void add_manual(CLI::App& program, int& exit_code) {
  const auto name = std::make_shared<std::string>(), folder = std::make_shared<std::string>();
  CLI::App* command = program.add_subcommand("manual", "Print the manual page of a command, in roff");
  CLI::Option* const place =
      command->add_option("COMMAND", *name, "a command of marble; without it, the page of marble itself");
  command->add_option("--directory", *folder, "write the pages of all commands into this folder")
      ->excludes(place);
  command->footer("To read it: marble manual solve | man -l -");
  command->callback([&program, name, folder, &exit_code] {
    const std::vector<Command> commands = command_tree(program);
    if (!folder->empty()) {
      exit_code = write_pages(commands, *folder);
      return;
    }
    const auto found = std::ranges::find(commands, name->empty() ? "marble" : *name, &Command::name);
    if (found == commands.end()) {
      complain(*name, "is not a command  (marble --help lists them all)");
      exit_code = kBadInput;
      return;
    }
    std::cout << (found == commands.begin() ? program_page(commands) : command_page(*found));
    exit_code = kAllSolved;
  });
}

}  // namespace marble::cli
