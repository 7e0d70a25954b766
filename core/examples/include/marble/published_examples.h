// The paper's three robotics problems with the parameters that its authors published:
// github.com/MarbleSolver/Marble, folder julia/examples, commits 7eb4b17 (rocket, gates) and 114e43d
// (hopper). The problems of examples.h have the same equations and sizes with other parameters.
#pragma once

#include "marble/problem.h"

namespace marble::examples {

/// Returns the rocket of Table I: 678 variables, 444 equalities, 718 inequalities, 40 pairs. Optimum
/// 380.714796. The triggered constraints hold below `trigger_altitude`, in m; the published value is 1.3 · 3.
[[nodiscard]] OwnedProblem published_rocket(double trigger_altitude = 1.3 * 3.0);

/// Returns the hopper, with the leg from foot to head, 60 steps: 1560 variables, 780 equalities, 300
/// inequalities and 540 pairs. Table I counts 540 inequalities and reports 29.20 (Gurobi), 29.21 (LCQPow) and
/// 31.68 (Marble).
[[nodiscard]] OwnedProblem published_hopper();

/// Parameters of the gates that differ between the published files and Table I.
struct PublishedGatesParameters {
  double horizon_s = 9.0;     ///< s, of 30 steps
  double slack_weight = 1.0;  ///< per metre beside a gate for one second
  bool end_at_rest = true;    ///< fixes position and velocity at the end; otherwise position and attitude
};

/// Returns the gates, with progress and the gates' errors as variables: 1706 variables, 760 equalities, 1942
/// inequalities and 120 pairs as in Table I. No tested parameters give its objective of 464.46.
[[nodiscard]] OwnedProblem published_gates(const PublishedGatesParameters& parameters = {});

}  // namespace marble::examples
