// When to stop, and the word for it.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "data/residual.h"
#include "marble/options.h"
#include "marble/solution.h"
#include "model/tolerances.h"

namespace marble {

/// That there is no answer.
[[nodiscard]] inline bool is_proof(Status status) {
  return status == Status::infeasible || status == Status::unbounded;
}
/// By a limit or a stop.
[[nodiscard]] inline bool ended_by_force(Status status) {
  return status == Status::cancelled || status == Status::time_limit || status == Status::iteration_limit;
}

struct Ending {
  Status status = Status::numerical_failure;
  std::string detail;
  std::vector<double> certificate;
};

/// The largest of the three.
[[nodiscard]] double largest(const Violations& violations);

/// Watches how the violation falls from one outer iteration to the next.
class StallDetector {
 public:
  /// True once `violation` has made no progress for tuning::patience outer iterations.
  [[nodiscard]] bool stalled(double violation);

 private:
  double best_ = std::numeric_limits<double>::infinity();
  int since_best_ = 0;
};

/// The word for a path that cannot go on at x: infeasible or unbounded, which are still to be proved, solved
/// to reduced accuracy, locally infeasible when `stalled`, else numerical failure.
[[nodiscard]] Ending explain_end(const ScaledProblem& p, const Options& options, const Iterate& x,
                                 const Violations& violations, double residual_norm, bool stalled);

/// "violations: equality 1e-9, …": what every detail ends with.
[[nodiscard]] std::string describe(const Violations& violations);

}  // namespace marble
