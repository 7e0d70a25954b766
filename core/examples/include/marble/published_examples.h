// The paper's three robotics problems, and two more, with the parameters that its authors published:
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

/// Horizon and safety distance of the robots.
struct PublishedRobotsParameters {
  int steps = 30;          ///< horizon, >= 2; there is no plan of 2
  double horizon_s = 5.0;  ///< s, > 0
  double distance = 5.0;   ///< m, >= 0: least |Δx| + |Δy| of any two; above 8 there is no plan
};

/// Returns the plan of three point masses in a plane that swap places (multi_robot_coordination.jl of that
/// folder): 1074 variables, 552 equalities, 90 inequalities and 360 pairs, 12 a step. Every order in which
/// they pass is a local minimum.
[[nodiscard]] OwnedProblem published_robots(const PublishedRobotsParameters& parameters = {});

/// Horizon of the rocket in space.
struct PublishedRocket3dParameters {
  int steps = 40;          ///< horizon, >= 2; there is no plan below 7
  double horizon_s = 4.0;  ///< s, > 0
};

/// Returns the rocket in space, linearized about upright, that is caught by a tower (of that folder): 1000
/// variables, 692 equalities, 1080 inequalities and 40 pairs, one a step.
[[nodiscard]] OwnedProblem published_rocket_3d(const PublishedRocket3dParameters& parameters = {});

}  // namespace marble::examples
