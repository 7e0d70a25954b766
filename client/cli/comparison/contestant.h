// Who is asked to solve: this solver by some options, or somebody else's program.
#pragma once

#include <stop_token>
#include <string>
#include <variant>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"

namespace marble::cli {

/// A shell's command that is given the problem's JSON file as its last word, and prints one line of JSON when
/// it is done: {"status": "...", "z": [...], "seconds": 0.1}. MARBLE_TIME_LIMIT_S in its environment says how
/// long it may take.
struct Peer {
  std::string command;
};

struct Contestant {
  std::string name;
  std::variant<Options, Peer> solver;
};

/// "NAME: OPTION=VALUE ...", without options the defaults. The error's field is `flag`.
[[nodiscard]] Expected<Contestant> contestant_by_options(const std::string& flag, const std::string& text,
                                                         const Options& base);
/// "NAME: COMMAND".
[[nodiscard]] Expected<Contestant> contestant_by_command(const std::string& flag, const std::string& text);

/// One solve of one problem by one of them.
struct Attempt {
  std::string status;     ///< its own word; "failed" where there is no answer
  std::string fault;      ///< why there is none
  std::vector<double> z;  ///< empty if there is none
  double seconds = 0.0;   ///< as told by itself, else of the whole program
  int iterations = 0;     ///< of this solver
  int factorizations = 0;
};

/// `file` holds the problem for peers. A peer is killed when it takes much longer than the limit.
[[nodiscard]] Attempt attempt(const Contestant& contestant, const OwnedProblem& problem,
                              const std::string& file, double time_limit_s, const std::stop_token& stop);

}  // namespace marble::cli
