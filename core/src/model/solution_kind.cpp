#include "marble/report/solution_kind.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string_view>

#include "model/tolerances.h"

namespace marble {
namespace {

struct Texts {
  const char *name, *text, *advice;
};

constexpr Texts kKinds[] = {
#define MARBLE_KIND(name, text, advice, means) {#name, text, advice},
#include "marble/contract.def"
};

namespace phrase {
#define MARBLE_PHRASE(name, text) constexpr const char* name = text;
#include "marble/contract.def"
}  // namespace phrase

std::string fixed(double value, int digits) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

// Rounds up, because the sentence says "at most". A gap is relative to the objective only if that is at least
// 1.
std::string distance(const SolutionFacts& s) {
  if (std::abs(s.objective) < 1.0) return fixed(std::ceil(1000.0 * s.gap) / 1000.0, 3);
  const double percent = 100.0 * s.gap;
  if (percent >= 10.0) return fixed(std::ceil(percent), 0) + " %";
  if (percent >= 1.0) return fixed(std::ceil(10.0 * percent) / 10.0, 1) + " %";
  return fixed(std::max(1.0, std::ceil(100.0 * percent)) / 100.0, 2) + " %";
}

std::string counted(std::int64_t count, const char* what) {
  return std::to_string(count) + ' ' + what + (count == 1 ? "" : "s");
}

// What a text has in braces.
std::string part(std::string_view name, const SolutionFacts& s) {
  const bool bounded = std::isfinite(s.gap);
  if (name == "within") return bounded && s.gap > Options().relative_gap_tolerance ? phrase::within : "";
  if (name == "optimum" && s.pairs == 0 && !bounded) return phrase::optimum_if_convex;
  if (name == "optimum" || name == "bound") return bounded ? phrase::bounded : phrase::not_bounded;
  if (name == "reason" && s.b_stationary == false) return phrase::another_branch;
  if (name == "reason")
    return s.b_stationary == true || s.pairs == 0 ? phrase::curvature : phrase::next_branch;
  if (name == "condition") return s.pairs == 0 ? phrase::if_not_convex : "";
  if (name == "budget") return s.budget_spent ? phrase::budget_spent : "";
  if (name == "starts") return s.starts > 1 ? phrase::more_starts : phrase::first_starts;
  if (name == "proof" && s.global_search) return phrase::proof_ended;
  if (name == "proof") return s.pairs == 0 ? "" : phrase::try_global;
  if (name == "more") return std::to_string(2 * std::int64_t{s.starts});
  if (name == "factorizations") return counted(s.factorizations, "factorization");
  if (name == "pairs") return counted(s.pairs, "pair");
  return name == "distance" ? distance(s) : advice(s.status);
}

std::string filled(std::string_view text, const SolutionFacts& s) {
  std::string out;
  for (auto open = text.find('{'); open != text.npos; open = text.find('{')) {
    const auto close = text.find('}', open);
    out.append(text.substr(0, open)).append(filled(part(text.substr(open + 1, close - open - 1), s), s));
    text.remove_prefix(close + 1);
  }
  return out.append(text);
}

const Texts& texts_of(SolutionKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

// Each segment has had the budget to itself: the sum of their factorizations says nothing of it.
bool solved_in_segments(const Solution& s) { return s.detail.find("segments; ") != std::string::npos; }

// Each search has a budget of its own, and option effort adds to that of the first one.
double most_factorizations(const Options& options) {
  return options.max_local_search_factorizations * (options.num_starts + options.effort);
}

}  // namespace

const char* to_string(SolutionKind kind) { return texts_of(kind).name; }

SolutionFacts facts_of(const Solution& s, const Options& options) {
  return {.status = s.status,
          .proved = s.proved,
          .stationarity = s.stationarity,
          .b_stationary = s.b_stationary,
          .second_order = s.second_order,
          .objective = s.objective,
          .bound = s.bound,
          .gap = s.gap,
          .feasible = within_tolerances(s.violations, options),
          .pairs = static_cast<std::int64_t>(s.complementarity_multipliers_L.size()),
          .factorizations = s.factorizations,
          .budget_spent = s.factorizations >= most_factorizations(options) && !solved_in_segments(s),
          .starts = options.num_starts,
          .global_search = options.global_search};
}

SolutionKind kind_of(const SolutionFacts& s) {
  switch (s.status) {
    case Status::solved:
      if (s.proved) return SolutionKind::proved_optimal;
      if (s.second_order == SecondOrder::saddle) return SolutionKind::saddle_point;
      if (s.second_order < SecondOrder::minimum || s.b_stationary == false)
        return SolutionKind::stationary_point;
      return s.second_order == SecondOrder::convex && s.pairs == 0 ? SolutionKind::optimal
                                                                   : SolutionKind::local_minimum;
    case Status::almost_solved:
      return SolutionKind::almost_solved;
    case Status::infeasible:
      return SolutionKind::proved_infeasible;
    case Status::locally_infeasible:
      return SolutionKind::no_feasible_point;
    case Status::unbounded:
      return SolutionKind::proved_unbounded;
    case Status::iteration_limit:
    case Status::time_limit:
    case Status::cancelled:
      return s.feasible ? SolutionKind::stopped_feasible : SolutionKind::stopped_infeasible;
    case Status::numerical_failure:
      break;
  }
  return SolutionKind::failed;
}

std::string kind_text(const SolutionFacts& s) {
  const SolutionKind kind = kind_of(s);
  std::string text = filled(texts_of(kind).text, s);
  if (s.maximize && kind == SolutionKind::local_minimum)
    text.replace(0, std::strlen("local minimum"), "local maximum");
  return text;
}

std::string what_to_try(const SolutionFacts& s) { return filled(texts_of(kind_of(s)).advice, s); }

}  // namespace marble
