// Provides all commands as one program, which the program marble runs.
#include <algorithm>
#include <csignal>
#include <exception>
#include <iostream>
#include <sstream>

#include "ampl/ampl_command_line.h"
#include "ampl/ampl_driver.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/suggestion.h"
#include "commands/commands.h"
#include "help/command_tree.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

// Arguments may contain file names that others chose.
int exit_of(const CLI::App& program, const CLI::ParseError& error) {
  std::stringstream faults;
  const int code = program.exit(error, std::cout, faults);
  for (std::string line; std::getline(faults, line);) std::cerr << without_controls(line) << '\n';
  return code == 0 ? kAllSolved : kBadInput;
}

// Returns the fault of a command or an option that does not exist; empty if there is no such word.
std::string wrong_word(const CLI::App& program, int argc, char** argv) {
  const std::vector<Command> commands = command_tree(program);
  std::vector<std::string> names;
  for (std::size_t i = 1; i < commands.size(); ++i) names.push_back(commands[i].name);
  const std::string first = argc > 1 ? argv[1] : "";
  const auto found = std::ranges::find(commands, first, &Command::name);
  if (!first.empty() && first.front() != '-' && (found == commands.end() || found == commands.begin()))
    return first + ": is not a command" + did_you_mean(first, names) + "  (marble --help lists them all)";
  for (const std::string& word : program.remaining(true)) {
    const std::string given = word.substr(0, word.find('='));
    if (given.size() < 2 || given.front() != '-') continue;
    const Command& command = found == commands.end() ? commands.front() : *found;
    std::vector<std::string> options;
    for (const Argument& option : command.options)
      options.insert(options.end(), option.names.begin(), option.names.end());
    const std::string called = command.name == "marble" ? "marble" : "marble " + command.name;
    return given + ": is not an option of " + called + did_you_mean(given, options) + "  (" + called +
           " --help lists them all)";
  }
  return "";
}

// Returns the word that a message of CLI11 refuses, as "--columns: kapa not in {…}" and "--priority: Check
// high value in {…} FAILED" do; empty if it has none.
std::string given_word(const std::string& what) {
  const std::size_t colon = what.find(": ");
  if (colon == std::string::npos) return "";
  std::string_view rest = std::string_view(what).substr(colon + 2);
  if (rest.starts_with("Check ")) rest.remove_prefix(6);
  for (const std::string_view after : {" not in ", " value in "}) {
    if (const std::size_t end = rest.find(after); end != std::string_view::npos)
      return std::string(rest.substr(0, end));
  }
  return "";
}

// Returns the fault of an argument that must be one of a few words; empty for any other. CLI11's own has the
// numbers that the words stand for.
std::string wrong_choice(const CLI::App& program, const CLI::ParseError& error) {
  if (dynamic_cast<const CLI::ValidationError*>(&error) == nullptr) return "";
  const std::string what = error.what(), name = what.substr(0, what.find(':'));
  const auto parsed = program.get_subcommands();
  if (parsed.empty()) return "";
  const std::vector<Command> commands = command_tree(program);
  const auto command = std::ranges::find(commands, parsed.front()->get_name(), &Command::name);
  for (const auto* arguments : {&command->options, &command->places}) {
    for (const Argument& argument : *arguments) {
      const bool named = argument.place == name || std::ranges::count(argument.names, name) > 0;
      if (!named || argument.choices.empty()) continue;
      std::string text;
      for (const std::string& choice : argument.choices) text += (text.empty() ? "" : ", ") + choice;
      const std::string given = given_word(what);
      return name + (given.empty() ? "" : " = " + given) + ": must be one of " + text +
             did_you_mean(given, argument.choices);
    }
  }
  return "";
}

}  // namespace
}  // namespace marble::cli

int main(int argc, char** argv) {
  using namespace marble::cli;
  std::signal(SIGPIPE, SIG_DFL);  // so that `marble example hopper | head` ends quietly
  if (ampl::is_ampl(argc, argv)) return ampl::drive(argc, argv);
  CLI::App program(
      "Solves quadratic programs with complementarity constraints, on a Marble server or in process.",
      "marble");
  program.require_subcommand(1);
  program.get_formatter()->column_width(36);
  program.footer(
      std::string(kExitCodes) +
      "\nThe server is --server ADDR, else MARBLE_SERVER, else 127.0.0.1:50051; ADDR is "
      "host:port, or several with commas between, or unix:PATH, or local for none.\nMARBLE_TOKEN, "
      "MARBLE_TLS_CA, "
      "MARBLE_TLS_CERTIFICATE and MARBLE_TLS_KEY are the defaults "
      "of "
      "their options.\nPyomo, AMPL and JuMP call marble STUB -AMPL [NAME=VALUE ...]; marble -= lists what "
      "may be set.");
  int exit_code = kAllSolved;
  add_solve(program, exit_code);
  add_explain(program, exit_code);
  add_batch(program, exit_code);
  add_submit(program, exit_code);
  add_result(program, exit_code);
  add_jobs(program, exit_code);
  add_job(program, exit_code);
  add_watch(program, exit_code);
  add_cancel(program, exit_code);
  add_delete(program, exit_code);
  add_plot(program, exit_code);
  add_coupled(program, exit_code);
  add_scenarios(program, exit_code);
  add_replay(program, exit_code);
  add_mpc(program, exit_code);
  add_compare(program, exit_code);
  add_reproduce(program, exit_code);
  add_convert(program, exit_code);
  add_example(program, exit_code);
  add_health(program, exit_code);
  add_info(program, exit_code);
  add_options(program, exit_code);
  add_completion(program, exit_code);
  add_manual(program, exit_code);
  add_version(program, exit_code);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::string wrong = error.get_exit_code() == 0 ? "" : wrong_word(program, argc, argv);
    if (wrong.empty()) wrong = wrong_choice(program, error);
    if (wrong.empty()) return exit_of(program, error);
    complain(wrong);
    return kBadInput;
  } catch (const std::exception& error) {
    complain(error.what());
    return kBadInput;
  }
  return exit_code;
}
