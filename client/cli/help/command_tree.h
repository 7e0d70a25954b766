// The commands and arguments of the program, as its help shows them.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace marble::cli {

struct Argument {
  std::vector<std::string> names;  ///< "-h", "--help"; empty if it is given by its place
  std::string place;               ///< what stands for it in the usage: "FILE"; of an option its value
  std::string description;
  std::vector<std::string> choices;  ///< the values that it may have; empty if others are possible
  bool takes_value = true;
  bool repeats = false;
  bool required = false;
};

struct Command {
  std::string name, description, footer;
  std::vector<Argument> options, places;  ///< places: in their order
};

/// Returns the program itself, then its commands in their order.
[[nodiscard]] std::vector<Command> command_tree(const CLI::App& program);

/// Returns the names of the solver options.
[[nodiscard]] std::vector<std::string> solver_option_names();

}  // namespace marble::cli
