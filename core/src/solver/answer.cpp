#include "solver/answer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/text_of.h"
#include "proof/balance.h"
#include "proof/stationarity.h"

namespace marble {
namespace {

// 0 · ∞ is NaN, and so is any sum that contains it.
bool all_finite(const std::vector<double>& values) {
  const auto size = static_cast<Eigen::Index>(values.size());
  return (Eigen::Map<const Vector>(values.data(), size).array() * 0.0).sum() == 0.0;
}

// For data near the largest double, even z = 0 may have a residual that overflows.
void clamp(double& value) {
  constexpr double kLargest = std::numeric_limits<double>::max();
  value = std::isnan(value) ? kLargest : std::clamp(value, -kLargest, kLargest);
}

double user_stationarity(const ScaledProblem& problem, const Images& images) {
  return max_abs(images.stationarity.cwiseQuotient(problem.variable_scale)) / problem.cost_scale;
}

}  // namespace

bool is_finite(const Solution& s) {
  return all_finite(s.z) && all_finite(s.equality_multipliers) && all_finite(s.inequality_multipliers) &&
         all_finite(s.complementarity_multipliers_L) && all_finite(s.complementarity_multipliers_R) &&
         all_finite(s.certificate) && std::isfinite(s.objective) && std::isfinite(s.violations.equality) &&
         std::isfinite(s.violations.inequality) && std::isfinite(s.violations.complementarity) &&
         std::isfinite(s.kkt_residual);
}

void take_point(const ScaledProblem& problem, const Iterate& x, Images& images, Solution& solution) {
  images.evaluate(problem, x);
  const double cost = 1.0 / problem.cost_scale;
  report(problem, x, solution);
  solution.objective = cost * images.objective + problem.c0;
  solution.violations = violations(problem, images);
  const auto slacks = problem.layout.inequality_part(images.rows.all);
  const double slackness = cost * max_abs(slacks.cwiseProduct(x.lambda_w()));
  const double stationarity = user_stationarity(problem, images);
  solution.kkt_residual = std::isnan(slackness) ? slackness : std::max(stationarity, slackness);
}

namespace {

// Replaces a point that has overflowed by z = 0, whatever the status of the run.
void take_zero(const ScaledProblem& problem, Images& images, Solution& solution) {
  Iterate zero(problem);
  take_point(problem, zero, images, solution);
  solution.certificate.clear();
  for (double* value : {&solution.objective, &solution.violations.equality, &solution.violations.inequality,
                        &solution.violations.complementarity, &solution.kkt_residual})
    clamp(*value);
  if (!ended_by_force(solution.status)) solution.status = Status::numerical_failure;
  solution.detail += "; its numbers overflowed: z is 0";
}

}  // namespace

Solution answer(const ScaledProblem& problem, const Options& options, const Ending& ending, const Iterate& x,
                const Run& run) {
  Images images(problem);
  Solution solution;
  solution.status = ending.status;
  solution.detail = ending.detail;
  solution.certificate = ending.certificate;
  take_point(problem, x, images, solution);
  if (!is_finite(solution)) {
    take_zero(problem, images, solution);
  } else if (is_solved(ending.status) && !is_balanced(problem, options, images, x)) {
    solution.status = Status::numerical_failure;
    solution.detail +=
        "; no solution: stationarity is violated by " + scientific(user_stationarity(problem, images), 2);
  } else if (is_solved(ending.status) && !is_balanced_in_user_units(problem, images, x)) {
    solution.status = ending.status == Status::solved ? Status::almost_solved : Status::numerical_failure;
    solution.detail += "; its numbers lie too far apart: stationarity is violated by " +
                       scientific(user_stationarity(problem, images), 2);
  }
  if (is_solved(solution.status)) solution.stationarity = classify(images, x);
  solution.iterations = run.iterations;
  solution.factorizations = run.factorizations;
  solution.times = run.times;
  solution.times.solve_s = run.elapsed_s();
  return solution;
}

}  // namespace marble
