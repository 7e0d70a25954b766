#include "line_search.h"

#include <gtest/gtest.h>

#include "newton.h"
#include "support/random_problem.h"

namespace marble {
namespace {

struct Step {
  explicit Step(std::uint64_t seed)
      : owned(testing::random_problem({}, seed)),
        problem(scale(Problem::create(owned.view()).value(), 10)),
        kkt(make_kkt(problem)),
        newton(problem, *kkt),
        sub(problem),
        x(problem),
        r(problem),
        d(problem),
        at(problem),
        along(problem) {
    std::srand(static_cast<unsigned>(seed));
    x.all.setRandom();
    sub.kappa = 0.1;
    sub.rho = 10.0;
    at.evaluate(problem, x);
    residual(sub, at, x, r);
    EXPECT_TRUE(newton.factor(sub, x, 1.0, true));
    newton.direction(sub, x, r, d, along);
  }
  [[nodiscard]] double norm_after(double alpha) const {
    Iterate moved = x;
    moved.all += alpha * d.all;
    Images images(problem);
    images.evaluate(problem, moved);
    Iterate fresh(problem);
    residual(sub, images, moved, fresh);
    return max_abs(fresh.all);
  }
  OwnedProblem owned;
  ScaledProblem problem;
  std::unique_ptr<Kkt> kkt;
  Newton newton;
  Subproblem sub;
  Iterate x, r, d;
  Images at, along;
};

TEST(ResidualNorm, AlongAStepIsThatOfTheMovedIterate) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Step step(seed);
    for (const double alpha : {0.0, 0.1, 0.7, 1.0}) {
      EXPECT_NEAR(residual_norm(step.sub, step.at, step.along, step.x, step.d, alpha), step.norm_after(alpha),
                  1e-10);
    }
  }
}

TEST(FilterLineSearch, AcceptsNewtonStepsOfConvexSubproblems) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Step step(seed);
    FilterLineSearch filter(step.problem);
    EXPECT_GT(filter.search(step.sub, step.at, step.along, step.x, step.d), 0.0) << seed;
  }
}

TEST(FilterLineSearch, RefusesAStepThatWorsensBothMeasures) {
  Step step(3);
  // Straight away from feasibility and uphill: against the Newton step, far.
  step.d.all *= -1e3;
  step.along.evaluate_rows(step.problem, step.d.z());
  step.along.evaluate_duals(step.problem, step.d);
  FilterLineSearch filter(step.problem);
  const double alpha = filter.search(step.sub, step.at, step.along, step.x, step.d);
  EXPECT_LT(alpha, 1e-2);
}

TEST(FilterLineSearch, NeverGoesBackToAPointItsFilterHolds) {
  Step step(5);
  FilterLineSearch filter(step.problem);
  double previous = step.norm_after(0.0);
  // Newton steps with the filter in between: the residual must come down, which it could not if points
  // recurred.
  for (int i = 0; i < 30; ++i) {
    const double alpha = filter.search(step.sub, step.at, step.along, step.x, step.d);
    if (alpha == 0.0) break;
    step.x.all += alpha * step.d.all;
    step.at.evaluate(step.problem, step.x);
    residual(step.sub, step.at, step.x, step.r);
    ASSERT_TRUE(step.newton.factor(step.sub, step.x, 1e-6, true));
    step.newton.direction(step.sub, step.x, step.r, step.d, step.along);
  }
  EXPECT_LT(max_abs(step.r.all), 1e-2 * previous);
}

TEST(FilterLineSearch, RefusesStepsThatAreNotNumbers) {
  Step step(4);
  step.d.all.setConstant(std::numeric_limits<double>::quiet_NaN());
  step.along.evaluate_rows(step.problem, step.d.z());
  FilterLineSearch filter(step.problem);
  EXPECT_EQ(filter.search(step.sub, step.at, step.along, step.x, step.d), 0.0);
}

}  // namespace
}  // namespace marble
