// What kind of answer a solution is, in words for its user, and what a better one costs.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "marble/options.h"
#include "marble/solution.h"

namespace marble {

/// What a solution is worth: by its status, its proof and the tests of its stationary point.
enum class SolutionKind {
  proved_optimal,      ///< within gap_tolerance of the bound
  optimal,             ///< of a problem without pairs whose Q is known to be convex, by the tolerances
  local_minimum,       ///< no better point is near; one may be elsewhere
  stationary_point,    ///< solved, but not decided whether it is a local minimum
  saddle_point,        ///< solved, and no local minimum
  almost_solved,       ///< the reduced tolerances only
  proved_infeasible,   ///< no point meets the constraints
  no_feasible_point,   ///< none was found; there may be one
  proved_unbounded,    ///< the objective falls without end
  stopped_feasible,    ///< a limit or a cancel ended the solve; z meets the tolerances
  stopped_infeasible,  ///< likewise; z does not meet the tolerances
  failed,              ///< no acceptable step was found
};

/// "proved_optimal", "optimal", …
[[nodiscard]] const char* to_string(SolutionKind kind);

/// What the kind of a solution, its text and its advice follow from. The clients for Python and Node and the
/// server's page have the same rules; tests/answers/kinds.json is the table of cases that holds them
/// together.
struct SolutionFacts {
  Status status = Status::numerical_failure;
  bool proved = false;
  Stationarity stationarity = Stationarity::unknown;
  std::optional<bool> b_stationary = {};
  SecondOrder second_order = SecondOrder::unknown;
  double objective = 0.0;
  double bound = -std::numeric_limits<double>::infinity();
  double gap = std::numeric_limits<double>::infinity();
  bool feasible = false;  ///< z is within the tolerances
  std::int64_t pairs = 0;
  std::int64_t factorizations = 0;
  /// The factorizations have reached the option local_search_budget. Never of an answer by segments, each of
  /// which has that budget.
  bool budget_spent = false;
  std::int32_t starts = 1;     ///< the option
  bool global_search = false;  ///< the option global
  bool maximize = false;       ///< the user's objective is the negative of the problem's
};

/// `options` are those that it was solved by.
[[nodiscard]] SolutionFacts facts_of(const Solution& solution, const Options& options);

[[nodiscard]] SolutionKind kind_of(const SolutionFacts& facts);

/// In one line: "proved optimal", "local minimum; no bound is known".
[[nodiscard]] std::string kind_text(const SolutionFacts& facts);

/// What may give a better answer, and what that costs, in a few sentences; empty where nothing does.
[[nodiscard]] std::string what_to_try(const SolutionFacts& facts);

}  // namespace marble
