// The paper's three robotics problems with the parameters that its authors published:
// github.com/MarbleSolver/Marble, folder julia/examples, commits 7eb4b17 (rocket, gates) and 114e43d
// (hopper). Those of examples.h have the same equations and sizes with parameters of their own.
#pragma once

#include "marble/problem.h"

namespace marble::examples {

/// The rocket of Table I: 678 variables, 444 equalities, 718 inequalities, 40 pairs. Optimum 380.714796.
/// Below `trigger_altitude`, in m, the triggered constraints hold; the published one is 1.3 · 3.
[[nodiscard]] OwnedProblem published_rocket(double trigger_altitude = 1.3 * 3.0);

/// The hopper, leg from foot to head, 60 steps: 1560 variables, 780 equalities, 300 inequalities and 540
/// pairs. Table I counts 540 inequalities, and tells 29.20 (Gurobi), 29.21 (LCQPow) and 31.68 (Marble).
[[nodiscard]] OwnedProblem published_hopper();

/// What of the gates is not the same in the published files and in Table I.
struct PublishedGatesParameters {
  double horizon_s = 9.0;     ///< s, of 30 steps
  double slack_weight = 1.0;  ///< of a metre beside a gate for a second
  bool end_at_rest = true;    ///< the end has a position and a velocity; else a position and an attitude
};

/// The gates, progress and the gates' errors as variables: 1706 variables, 760 equalities, 1942 inequalities
/// and 120 pairs as in Table I, whose objective of 464.46 no parameters that were tried give.
[[nodiscard]] OwnedProblem published_gates(const PublishedGatesParameters& parameters = {});

}  // namespace marble::examples
