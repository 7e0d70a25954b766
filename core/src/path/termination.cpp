#include "path/termination.h"

#include <algorithm>

#include "model/text_of.h"
#include "model/tuning.h"
#include "path/certificate.h"

namespace marble {

double largest(const Violations& v) { return std::max({v.equality, v.inequality, v.complementarity}); }

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
  const std::string residual_text = "scaled KKT residual " + scientific(residual_norm, 2) + "; ";
  if (within_tolerances(violations, options, tuning::reduced_factor) &&
      residual_norm <= tuning::reduced_residual) {
    return {Status::almost_solved, "no further progress was possible; " + residual_text + where, {}};
  }
  if (stalled) {
    return {Status::locally_infeasible,
            "the violation is stationary: no feasible point near; " + residual_text + where,
            {}};
  }
  return {Status::numerical_failure, "no acceptable step; " + residual_text + where, {}};
}

std::string describe(const Violations& violations) {
  return "violations: equality " + scientific(violations.equality, 2) + ", inequality " +
         scientific(violations.inequality, 2) + ", complementarity " +
         scientific(violations.complementarity, 2);
}

}  // namespace marble
