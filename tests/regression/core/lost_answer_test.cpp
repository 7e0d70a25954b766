// A warm solve with max_iterations = 10 was STATUS_SOLVED; with 11 it was STATUS_ITERATION_LIMIT, without an
// answer.
//
// The warm start's answer had been kept while a cold start had its say. The exact solution of the path's
// branch changed places with it, and was then set aside itself because the path was lower for a while: both
// were lost.
#include <gtest/gtest.h>

#include <limits>

#include "marble/solver.h"
#include "support/independent_check.h"

namespace marble {
namespace {

// ½(x₁ − 3)² + ½(x₂ − 4)² + ½‖y‖², 0 ≤ xᵢ ⊥ yᵢ ≥ 0, y₁ + y₂ ≥ 0.1: x = (3, 0) is a local optimum that no
// switch leaves. At κ = 10⁻² the path is feasible to loose tolerances and clearly lower than any branch. A
// pair u ≥ 1 ⊥ v makes a start with u = 0 one to be restored.
OwnedProblem lower_path() {
  OwnedProblem p;
  p.name = "a path lower than its branch";
  p.g = {-3.0, -4.0, 0.0, 0.0, 0.0, 0.0};
  Triplets hessian, rows, left, right;
  for (Index i = 0; i < 6; ++i) hessian.add(i, i, 1.0);
  rows.add(0, 2, 1.0), rows.add(0, 3, 1.0), rows.add(1, 4, 1.0);
  left.add(0, 0, 1.0), left.add(1, 1, 1.0), left.add(2, 4, 1.0);
  right.add(0, 2, 1.0), right.add(1, 3, 1.0), right.add(2, 5, 1.0);
  p.Q = compress(6, 6, hessian, "Q").value();
  p.C = compress(2, 6, rows, "C").value();
  p.d = {-0.1, -1.0};
  p.L = compress(3, 6, left, "L").value();
  p.R = compress(3, 6, right, "R").value();
  p.l = p.r = {0.0, 0.0, 0.0};
  return p;
}

TEST(LostAnswer, OnceThereIsOneMoreIterationsNeverLoseIt) {
  const OwnedProblem p = lower_path();
  Solution start;
  start.z = {3.0, 0.0, 0.0, 0.1, 0.0, 1.0};
  start.inequality_multipliers.resize(2);
  start.complementarity_multipliers_L.resize(3);
  start.complementarity_multipliers_R.resize(3);
  start.reference_objective = -1e30;  // whatever the warm start gives, a cold one is to try as well
  double before = std::numeric_limits<double>::infinity();
  for (int limit = 0; limit <= 40; ++limit) {
    Options options;
    options.max_iterations = limit;
    options.inequality_tolerance = options.complementarity_tolerance = 5e-2;
    const Solution s = solve_in_process(p.view(), options, {.warm_start = &start}).value();
    if (s.status != Status::solved) {
      EXPECT_EQ(before, std::numeric_limits<double>::infinity()) << limit << ": " << s.detail;
      continue;
    }
    EXPECT_LE(s.objective, before + 1e-9) << limit << ": " << s.detail;
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 5e-2) << limit;
    before = s.objective;
  }
  EXPECT_NEAR(before, -7.495, 1e-6) << "and the path goes on to the branch that it promised";
}

}  // namespace
}  // namespace marble
