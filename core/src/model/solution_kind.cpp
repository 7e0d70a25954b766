#include "marble/report/solution_kind.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "model/tolerances.h"

namespace marble {
namespace {

constexpr const char* kSpent =
    "The search for better branches has spent local_search_budget: a larger one lets it go on. ";

std::string fixed(double value, int digits) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

// Rounded up, for the sentence says "at most". A gap is relative to the objective only where that is above 1.
std::string distance(const SolutionFacts& s) {
  if (std::abs(s.objective) < 1.0) return fixed(std::ceil(1000.0 * s.gap) / 1000.0, 3);
  const double percent = 100.0 * s.gap;
  if (percent >= 10.0) return fixed(std::ceil(percent), 0) + " %";
  if (percent >= 1.0) return fixed(std::ceil(10.0 * percent) / 10.0, 1) + " %";
  return fixed(std::max(1.0, std::ceil(100.0 * percent)) / 100.0, 2) + " %";
}

std::string bound_text(const SolutionFacts& s) {
  return std::isfinite(s.gap) ? "at most " + distance(s) + " from the optimum" : "no bound is known";
}

std::string stationary_text(const SolutionFacts& s) {
  std::string text = "stationary point only: ";
  if (s.b_stationary == false) {
    text += "the objective falls along another branch";
  } else if (s.b_stationary == true || s.pairs == 0) {
    text += "its curvature was not decided";
  } else {
    text += "a better branch may lie next to it";
  }
  return text + "; " + bound_text(s);
}

std::string starts_advice(const SolutionFacts& s) {
  const std::string this_solve = " (this solve: " + std::to_string(s.factorizations) +
                                 (s.factorizations == 1 ? " factorization)." : " factorizations).");
  if (s.starts <= 1) return "starts=8 searches 8 times, for about 8 times the work" + this_solve;
  return "starts=" + std::to_string(2 * std::int64_t{s.starts}) +
         " searches twice as often, for about twice the work" + this_solve;
}

std::string global_advice(const SolutionFacts& s) {
  if (s.global_search) return " The proof did not come to its end: detail says why.";
  if (s.pairs == 0) return "";
  return " global=true searches the branches of the " + std::to_string(s.pairs) +
         (s.pairs == 1 ? " pair" : " pairs") +
         " for the best one and proves it; that may take much longer, and time_limit_s ends it with a bound.";
}

// Each segment has had the budget to itself: the sum of their factorizations says nothing of it.
bool solved_in_segments(const Solution& s) { return s.detail.find("segments; ") != std::string::npos; }

}  // namespace

const char* to_string(SolutionKind kind) {
  constexpr const char* kNames[] = {
      "proved_optimal",   "optimal",          "local_minimum",      "stationary_point",
      "saddle_point",     "almost_solved",    "proved_infeasible",  "no_feasible_point",
      "proved_unbounded", "stopped_feasible", "stopped_infeasible", "failed"};
  static_assert(std::size(kNames) == static_cast<std::size_t>(SolutionKind::failed) + 1);
  return kNames[static_cast<std::size_t>(kind)];
}

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
          .budget_spent = s.factorizations >= options.local_search_budget && !solved_in_segments(s),
          .starts = options.starts,
          .global_search = options.global};
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
    case Status::solved_reduced:
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
  switch (kind_of(s)) {
    case SolutionKind::proved_optimal:
      return s.gap > Options().gap_tolerance && std::isfinite(s.gap)
                 ? "proved optimal to within " + distance(s)
                 : "proved optimal";
    case SolutionKind::optimal:
      return "optimal: Q is convex, and there are no pairs";
    case SolutionKind::local_minimum: {
      const std::string minimum = s.maximize ? "local maximum; " : "local minimum; ";
      const bool is_qp = s.pairs == 0 && !std::isfinite(s.gap);
      return minimum + (is_qp ? "the optimum where Q is convex" : bound_text(s));
    }
    case SolutionKind::stationary_point:
      return stationary_text(s);
    case SolutionKind::saddle_point:
      return "saddle point: the objective falls along a direction of negative curvature";
    case SolutionKind::almost_solved:
      return "almost solved: the tolerances are met up to a factor of 100 only";
    case SolutionKind::proved_infeasible:
      return "proved infeasible: no point meets the constraints";
    case SolutionKind::no_feasible_point:
      return "no feasible point found; infeasibility is not proved";
    case SolutionKind::proved_unbounded:
      return "proved unbounded: the objective falls without end";
    case SolutionKind::stopped_feasible:
      return "stopped at a feasible point; " + bound_text(s);
    case SolutionKind::stopped_infeasible:
      return "stopped before a feasible point was found";
    case SolutionKind::failed:
      break;
  }
  return "failed: no acceptable step was found";
}

std::string what_to_try(const SolutionFacts& s) {
  switch (kind_of(s)) {
    case SolutionKind::proved_optimal:
    case SolutionKind::optimal:
      return "";
    case SolutionKind::local_minimum:
      return (s.pairs == 0 ? "Where Q is not convex: " : "") + starts_advice(s) + global_advice(s);
    case SolutionKind::stationary_point:
      return std::string(s.budget_spent ? kSpent : "") + starts_advice(s) + global_advice(s);
    case SolutionKind::saddle_point:
      return "Raise local_search_budget or time_limit_s: the descent from the saddle point was cut short.";
    default:
      return advice(s.status);
  }
}

}  // namespace marble
