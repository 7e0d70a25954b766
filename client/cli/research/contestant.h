// Provides contestants: this solver with some options, or another program.
#pragma once

#include <span>
#include <stop_token>
#include <string>
#include <variant>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"

namespace marble::cli {

// Measures a point by plain loops over the user's own data: for any solver, and without relying on its
// report.

/// The measure of a pair's distance from complementarity.
enum class PairMeasure {
  smaller_side,  ///< |min(s, t)|
  product,       ///< |s·t|, as the paper's authors use: s = t = 10⁻³ counts as complementary to 10⁻⁶
};

/// Measures of a point z, with s = L z + l and t = R z + r; all in the user's units.
struct Measures {
  double objective = 0.0;     ///< ½zᵀQz + gᵀz + c₀
  double equality = 0.0;      ///< max |A z + b|
  double inequality = 0.0;    ///< max −(C z + d), −s, −t; at least 0
  double smaller_side = 0.0;  ///< max |min(s, t)|
  double product = 0.0;       ///< max |s·t|; NaN if unknown

  /// Returns true if no measure exceeds `tolerance`. If the product is unknown the smaller side is used.
  [[nodiscard]] bool feasible(double tolerance, PairMeasure pairs) const;
};

/// Measures z, which must have one number per variable.
[[nodiscard]] Measures measure(const OwnedProblem& problem, std::span<const double> z);

/// A shell command whose last word is the problem's JSON file. It prints one line of JSON when it is done:
/// {"status": "...", "z": [...], "seconds": 0.1}. MARBLE_TIME_LIMIT_S in its environment is its time limit.
struct Peer {
  std::string command;
};

struct Contestant {
  std::string name;
  std::variant<Options, Peer> solver;
};

/// Parses "NAME: OPTION=VALUE ..."; without options the defaults. The error's field is `flag`.
[[nodiscard]] Expected<Contestant> contestant_by_options(const std::string& flag, const std::string& text,
                                                         const Options& base);
/// Parses "NAME: COMMAND".
[[nodiscard]] Expected<Contestant> contestant_by_command(const std::string& flag, const std::string& text);

/// One solve of one problem by one contestant.
struct Attempt {
  std::string status;     ///< the contestant's own word; "failed" without a solution
  std::string fault;      ///< the reason if there is no solution
  std::vector<double> z;  ///< empty if there is none
  double seconds = 0.0;   ///< as the contestant reports, else of the whole program
  int iterations = 0;     ///< of this solver
  int factorizations = 0;
};

/// Solves once. `file` holds the problem for peers. A peer that takes much longer than the limit is killed.
[[nodiscard]] Attempt attempt(const Contestant& contestant, const OwnedProblem& problem,
                              const std::string& file, double time_limit_s, const std::stop_token& stop);

}  // namespace marble::cli
