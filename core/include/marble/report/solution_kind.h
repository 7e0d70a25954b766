// The kind of a solution, in words, and what a better one costs.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "marble/options.h"
#include "marble/solution.h"

namespace marble {

/// What a solution is worth: by its status, its proof and the tests of its stationary point. Listed, with
/// what they mean and their texts, in contract.def.
enum class SolutionKind {
#define MARBLE_KIND(name, ...) name,
#include "marble/contract.def"
};

/// "proved_optimal", "optimal", …
[[nodiscard]] const char* to_string(SolutionKind kind);

/// What the kind of a solution, its text and its advice follow from. Python's client has the same rules, and
/// so has the Node client, whose rules the server's page uses; tests/answers/kinds.json has cases for all of
/// them.
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
  bool budget_spent = false;   ///< the factorizations have reached the option local_search_budget
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
