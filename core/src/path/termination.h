// When to stop, and with which status.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "marble/options.h"
#include "marble/solution.h"
#include "model/residual.h"
#include "model/tolerances.h"

namespace marble {

/// True for a proof that there is no solution.
[[nodiscard]] inline bool is_proof(Status status) {
  return status == Status::infeasible || status == Status::unbounded;
}
/// True if a limit or a stop ended the run.
[[nodiscard]] inline bool ended_by_force(Status status) {
  return status == Status::cancelled || status == Status::time_limit || status == Status::iteration_limit;
}

struct Ending {
  Status status = Status::numerical_failure;
  std::string detail;
  std::vector<double> certificate;
};

/// Returns the largest of the three violations.
[[nodiscard]] double largest(const Violations& violations);

/// Observes the decrease of the violation between outer iterations.
class StallDetector {
 public:
  /// True if `violation` has made no progress for tuning::patience outer iterations.
  [[nodiscard]] bool stalled(double violation);

 private:
  double best_ = std::numeric_limits<double>::infinity();
  int since_best_ = 0;
};

/// Returns the status of a path that cannot continue from x: infeasible or unbounded (still to be proved),
/// solved to reduced accuracy, locally infeasible if `stalled`, else numerical failure.
[[nodiscard]] Ending explain_end(const ScaledProblem& p, const Options& options, const Iterate& x,
                                 const Violations& violations, double residual_norm, bool stalled);

/// Returns "violations: equality 1e-9, …", the end of every detail.
[[nodiscard]] std::string describe(const Violations& violations);

}  // namespace marble
