#include "run/termination.h"

#include <algorithm>
#include <cstdio>

#include "run/certificate.h"
#include "tuning.h"

namespace marble {

double largest(const Violations& v) { return std::max({v.equality, v.inequality, v.complementarity}); }

bool within_tolerances(const Violations& violations, const Options& options, double factor) {
  return violations.equality <= factor * options.equality_tolerance &&
         violations.inequality <= factor * options.inequality_tolerance &&
         violations.complementarity <= factor * options.complementarity_tolerance;
}

bool StallDetector::stalled(double violation) {
  if (violation < tuning::progress * best_) {
    best_ = violation;
    since_best_ = 0;
  } else {
    ++since_best_;
  }
  return since_best_ >= tuning::patience;
}

Ending explain_end(const ScaledProblem& p, const Options& options, const Iterate& x,
                   const Violations& violations, double residual_norm, bool stalled) {
  const std::string where = describe(violations);
  if (seems_infeasible(p, x)) return {Status::infeasible, where, {}};
  if (seems_unbounded(p, x)) return {Status::unbounded, where, {}};
  char residual_text[64];
  std::snprintf(residual_text, sizeof residual_text, "scaled KKT residual %.2e; ", residual_norm);
  if (within_tolerances(violations, options, tuning::reduced_factor) &&
      residual_norm <= tuning::reduced_residual) {
    return {Status::solved_reduced, "no further progress was possible; " + (residual_text + where), {}};
  }
  if (stalled) {
    return {Status::locally_infeasible,
            "the violation is stationary: no feasible point near; " + (residual_text + where),
            {}};
  }
  return {Status::numerical_failure, "no acceptable step; " + (residual_text + where), {}};
}

std::string describe(const Violations& violations) {
  char text[160];
  std::snprintf(text, sizeof text, "violations: equality %.2e, inequality %.2e, complementarity %.2e",
                violations.equality, violations.inequality, violations.complementarity);
  return text;
}

}  // namespace marble
