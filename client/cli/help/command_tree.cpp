#include "help/command_tree.h"

#include "marble/options.h"

namespace marble::cli {
namespace {

// Returns "a" and "b" of "TEXT:{a,b}".
std::vector<std::string> choices_of(const std::string& type) {
  const std::size_t begin = type.find('{'), end = type.find('}');
  std::vector<std::string> choices;
  if (begin == std::string::npos || end == std::string::npos) return choices;
  std::stringstream list(type.substr(begin + 1, end - begin - 1));
  for (std::string choice; std::getline(list, choice, ',');) choices.push_back(choice);
  return choices;
}

Argument argument_of(const CLI::Option& option) {
  Argument argument;
  for (const std::string& name : option.get_snames()) argument.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) argument.names.push_back("--" + name);
  const std::string type = option.get_type_name();
  argument.takes_value = option.get_items_expected_max() > 0;
  argument.place = argument.names.empty() ? option.get_name(true) : type.substr(0, type.find(':'));
  argument.description = option.get_description();
  argument.choices = choices_of(type);
  argument.repeats = option.get_items_expected_max() > 1;
  argument.required = option.get_required();
  return argument;
}

Command command_of(const CLI::App& app) {
  Command command{app.get_name(), app.get_description(), app.get_footer(), {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    Argument argument = argument_of(*option);
    (argument.names.empty() ? command.places : command.options).push_back(std::move(argument));
  }
  return command;
}

}  // namespace

std::vector<Command> command_tree(const CLI::App& program) {
  std::vector<Command> commands{command_of(program)};
  for (const CLI::App* command : program.get_subcommands(std::function<bool(const CLI::App*)>()))
    commands.push_back(command_of(*command));
  return commands;
}

std::vector<std::string> solver_option_names() {
  std::vector<std::string> names;
  for (const OptionInfo& option : option_table()) names.emplace_back(option.name);
  return names;
}

}  // namespace marble::cli
