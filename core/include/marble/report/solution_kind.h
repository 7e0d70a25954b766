// The kind of a solution, in words for users, and the cost of a better one.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "marble/options.h"
#include "marble/solution.h"

namespace marble {

/// The kind of a solution, by its status, its proof and the tests of its stationary point. Listed, with the
/// meanings and texts, in contract.def.
enum class SolutionKind {
#define MARBLE_KIND(name, ...) name,
#include "marble/contract.def"
};

/// "proved_optimal", "optimal", …
[[nodiscard]] const char* to_string(SolutionKind kind);

/// The facts that determine the kind of a solution, its text and its advice. The clients for Python and Node
/// and the server's page have the same rules; the table of cases tests/answers/kinds.json keeps them the
/// same.
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
  /// The factorizations have reached the option max_local_search_factorizations. False for a solution by
  /// segments, each of which has that budget.
  bool budget_spent = false;
  std::int32_t starts = 1;     ///< the option of that name
  bool global_search = false;  ///< the option of that name
  bool maximize = false;       ///< the user's objective is the negative of the problem's
};

/// `options` are those of the solve.
[[nodiscard]] SolutionFacts facts_of(const Solution& solution, const Options& options);

[[nodiscard]] SolutionKind kind_of(const SolutionFacts& facts);

/// Returns one line: "proved optimal", "local minimum; no bound is known".
[[nodiscard]] std::string kind_text(const SolutionFacts& facts);

/// Returns a few sentences on what may give a better solution and what that costs; empty if nothing does.
[[nodiscard]] std::string what_to_try(const SolutionFacts& facts);

}  // namespace marble
