// Parses the command line that AMPL's solvers share: STUB -AMPL [NAME=VALUE ...].
#pragma once

#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/nonlinear.h"
#include "marble/options.h"

namespace marble::cli::ampl {

/// The parsed command line.
struct CommandLine {
  enum class Asks { solve, version, options };
  Asks asks = Asks::solve;
  std::string stub;        ///< the .nl file's path without its extension
  bool from_ampl = false;  ///< -AMPL: no one reads standard output, the message is in the .sol file
  std::string sol_path;    ///< from -oFILE, else STUB.sol
  std::vector<std::string> assignments;  ///< NAME=VALUE, in their order
};

/// True if this is such a command line and not a subcommand: -AMPL anywhere, or first -v, -= or -oFILE.
[[nodiscard]] bool is_ampl(int argc, const char* const* argv);

/// Errors: invalid_argument (an unknown word, no stub).
[[nodiscard]] Expected<CommandLine> parse(int argc, const char* const* argv);

/// The settings of the assignments; a later one overrides.
struct Settings {
  Options options;
  nonlinear::Settings nonlinear;  ///< for a nonlinear file
  std::string server;             ///< empty, or "local": this process
  bool reports = false;           ///< outlev: a row per iteration, on standard output
};

/// Splits AMPL's option marble_options into words at blanks: "name=value", "name = value" or, for a switch,
/// "name".
[[nodiscard]] std::vector<std::string> assignments_of(const std::string& text);

/// Applies assignments. The names are those of the solver's options (marble options), those of
/// nonlinear_words(), and `server` and `outlev`. Errors: invalid_argument, with the name.
[[nodiscard]] Expected<void> apply(const std::vector<std::string>& assignments, Settings& settings);

/// Prints the names and their meanings, for -=.
void print_options();

}  // namespace marble::cli::ampl
