// The command line that AMPL's solvers share: STUB -AMPL [NAME=VALUE ...].
#pragma once

#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/nonlinear.h"
#include "marble/options.h"

namespace marble::cli::ampl {

/// What a front end asks for.
struct CommandLine {
  enum class Asks { solve, version, options };
  Asks asks = Asks::solve;
  std::string stub;        ///< the .nl file's path without its extension
  bool from_ampl = false;  ///< -AMPL: nobody reads standard output, the message is in the .sol file
  std::string sol_path;    ///< of -oFILE, else STUB.sol
  std::vector<std::string> assignments;  ///< NAME=VALUE, in their order
};

/// Whether this is such a command line and none of a subcommand: -AMPL anywhere, or first -v, -= or -oFILE.
[[nodiscard]] bool is_ampl(int argc, const char* const* argv);

/// Errors: invalid_argument (a word that means nothing here, no stub).
[[nodiscard]] Expected<CommandLine> parse(int argc, const char* const* argv);

/// What the assignments say; a later one counts.
struct Settings {
  Options options;
  nonlinear::Settings nonlinear;  ///< of a nonlinear file
  std::string server;             ///< empty, or "local": this process
  bool tells = false;             ///< outlev: a row an iteration, on standard output
};

/// "name=value", "name = value" or, of a switch, "name": of AMPL's option marble_options, words between
/// blanks.
[[nodiscard]] std::vector<std::string> assignments_of(const std::string& text);

/// The names are those of the solver's options (marble options), those of nonlinear_words(), and `server` and
/// `outlev`. Errors: invalid_argument, with the name.
[[nodiscard]] Expected<void> apply(const std::vector<std::string>& assignments, Settings& settings);

/// For -=: the names and what they mean.
void print_options();

}  // namespace marble::cli::ampl
