#include "path/line_search.h"

#include <gtest/gtest.h>

#include <limits>

#include "dense_system.h"
#include "path/newton.h"
#include "random_setting.h"

namespace marble {
namespace {

struct Step {
  explicit Step(std::uint64_t seed)
      : owned(testing::random_problem({}, seed)),
        random(seed),
        problem(scale(Problem::create(owned.view()).value(), 10)),
        kkt(make_kkt(problem)),
        newton(problem, *kkt),
        sub(problem),
        x(problem),
        r(problem),
        d(problem),
        at(problem),
        along(problem) {
    random.fill(x.all);
    sub.kappa = 0.1;
    sub.rho = 10.0;
    at.evaluate(problem, x);
    residual(sub, at, x, r);
    EXPECT_TRUE(newton.factor(sub, x, 1.0, true));
    EXPECT_TRUE(newton.direction(sub, x, r, d, along));
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
  testing::RandomVectors random;
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

TEST(ResidualNorm, IsNoNumberIfAnyEntryIsNone) {
  const Step sound(1);
  for (Eigen::Index i = 0; i < sound.d.all.size(); ++i) {
    Step step(1);
    step.d.all[i] = std::numeric_limits<double>::quiet_NaN();
    step.along.evaluate_rows(step.problem, step.d.z());
    step.along.evaluate_duals(step.problem, step.d);
    EXPECT_TRUE(std::isnan(residual_norm(step.sub, step.at, step.along, step.x, step.d, 1.0))) << i;
  }
}

TEST(FilterLineSearch, AcceptsNewtonStepsOfConvexSubproblems) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Step step(seed);
    FilterLineSearch filter(step.problem);
    EXPECT_GT(filter.search(step.sub, step.at, step.along, step.x, step.d), 0.0) << seed;
  }
}

TEST(Measures, AreTheLiteralSumsAtTheMovedPoint) {
  for (const auto& sizes : testing::all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const testing::Setting s(sizes, seed);
      const ScaledProblem& p = s.problem;
      Iterate d(p);
      testing::RandomVectors(seed).fill(d.all);
      Images along(p);
      along.evaluate_rows(p, d.z());
      along.evaluate_duals(p, d);
      for (const double alpha : {0.0, 0.25, 1.0}) {
        Iterate moved = s.x;
        moved.all += alpha * d.all;
        Iterate r(p);
        r.all = testing::literal_residual(p, s.sub, moved);
        const double theta = r.y().lpNorm<1>() + r.lambda_w().lpNorm<1>() + r.lambda_L().lpNorm<1>() +
                             r.lambda_R().lpNorm<1>();
        const auto penalty = [&](const Vector& lambda, const Vector& estimate) {
          const Vector e = (lambda - estimate) / s.sub.rho;
          return estimate.dot(e) + 0.5 * s.sub.rho * e.squaredNorm();
        };
        const Vector z = moved.z();
        double phi = 0.5 * z.dot(testing::dense(p.Q) * z) + p.g.dot(z);
        for (const double v : Vector(moved.v())) phi -= s.sub.kappa * std::log(testing::p(v, s.sub.kappa));
        phi += penalty(moved.y(), s.sub.equality_estimate) +
               penalty(moved.lambda_w(), s.sub.row_estimate.inequality()) +
               penalty(moved.lambda_L(), s.sub.row_estimate.s()) +
               penalty(moved.lambda_R(), s.sub.row_estimate.t());
        const Measures m = measure(s.sub, s.images, along, s.x, d, alpha);
        EXPECT_NEAR(m.theta, theta, 1e-12 * (1.0 + theta));
        EXPECT_NEAR(m.phi, phi, 1e-12 * (1.0 + std::abs(phi)));
      }
    }
  }
}

TEST(Measures, SlopeIsTheFiniteDifferenceOfPhi) {
  for (const auto& sizes : testing::all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const testing::Setting s(sizes, seed);
      Iterate d(s.problem);
      testing::RandomVectors(seed).fill(d.all);
      Images along(s.problem);
      along.evaluate_rows(s.problem, d.z());
      along.evaluate_duals(s.problem, d);
      const double h = 1e-6;
      const double difference =
          (measure(s.sub, s.images, along, s.x, d, h).phi - measure(s.sub, s.images, along, s.x, d, -h).phi) /
          (2.0 * h);
      EXPECT_NEAR(phi_slope(s.sub, s.images, s.x, d), difference, 1e-7);
    }
  }
}

// A random direction, which the filter knows nothing about.
void turn_at_random(Step& step, double length) {
  step.d.all = length * step.random.next(step.d.all.size());
  step.along.evaluate_rows(step.problem, step.d.z());
  step.along.evaluate_duals(step.problem, step.d);
}

TEST(FilterLineSearch, RefusesStepsThatWorsenBothMeasures) {
  int tried = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    Step step(seed);
    turn_at_random(step, 1.0);
    const Measures now = measure(step.sub, step.at, step.along, step.x, step.d, 0.0);
    bool worse_everywhere = true;
    for (double alpha = 1.0; alpha > 1e-9; alpha *= 0.5) {
      const Measures then = measure(step.sub, step.at, step.along, step.x, step.d, alpha);
      worse_everywhere = worse_everywhere && then.theta > now.theta && then.phi > now.phi;
    }
    if (!worse_everywhere) continue;
    ++tried;
    FilterLineSearch filter(step.problem);
    EXPECT_EQ(filter.search(step.sub, step.at, step.along, step.x, step.d), 0.0) << seed;
  }
  EXPECT_GT(tried, 20);
}

TEST(FilterLineSearch, EveryAcceptedStepImprovesOneOfTheMeasures) {
  int accepted = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    Step step(seed);
    turn_at_random(step, seed % 2 == 0 ? 1.0 : 10.0);
    const Measures now = measure(step.sub, step.at, step.along, step.x, step.d, 0.0);
    FilterLineSearch filter(step.problem);
    const double alpha = filter.search(step.sub, step.at, step.along, step.x, step.d);
    if (alpha == 0.0) continue;
    ++accepted;
    const Measures then = measure(step.sub, step.at, step.along, step.x, step.d, alpha);
    EXPECT_TRUE(then.theta < now.theta || then.phi < now.phi) << seed;
  }
  EXPECT_GT(accepted, 50);
}

TEST(FilterLineSearch, NeverAcceptsAPointThatOneItHasLeftDominates) {
  int accepted = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Step step(seed);
    FilterLineSearch filter(step.problem);
    std::vector<Measures> left;
    for (int i = 0; i < 60; ++i) {
      turn_at_random(step, 0.5);
      const Measures now = measure(step.sub, step.at, step.along, step.x, step.d, 0.0);
      // So far from feasible no step is judged by φ alone, and every point left enters the filter.
      ASSERT_GT(now.theta, 0.1);
      const double alpha = filter.search(step.sub, step.at, step.along, step.x, step.d);
      if (alpha == 0.0) continue;
      ++accepted;
      left.push_back(now);
      const Measures then = measure(step.sub, step.at, step.along, step.x, step.d, alpha);
      for (const Measures& entry : left) EXPECT_FALSE(then.theta >= entry.theta && then.phi >= entry.phi);
      step.x.all += alpha * step.d.all;
      step.at.evaluate(step.problem, step.x);
    }
  }
  EXPECT_GT(accepted, 100);
}

TEST(FilterLineSearch, DoesNotGoBackToAPointItHasLeftUntilReset) {
  int tried = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Step step(seed);
    turn_at_random(step, 0.5);
    FilterLineSearch used(step.problem);
    const double alpha = used.search(step.sub, step.at, step.along, step.x, step.d);
    if (alpha == 0.0) continue;
    step.x.all += alpha * step.d.all;
    step.at.evaluate(step.problem, step.x);
    step.d.all *= -alpha;
    step.along.evaluate_rows(step.problem, step.d.z());
    step.along.evaluate_duals(step.problem, step.d);
    FilterLineSearch fresh(step.problem);
    if (fresh.search(step.sub, step.at, step.along, step.x, step.d) != 1.0) continue;
    ++tried;  // one that knows nothing would go straight back
    EXPECT_LT(used.search(step.sub, step.at, step.along, step.x, step.d), 1.0) << seed;
    used.reset();
    EXPECT_EQ(used.search(step.sub, step.at, step.along, step.x, step.d), 1.0) << seed;
  }
  EXPECT_GT(tried, 5);
}

TEST(FilterLineSearch, ConvergesWithNewtonSteps) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Step step(seed);
    FilterLineSearch filter(step.problem);
    for (int i = 0; i < 60; ++i) {
      const double alpha = filter.search(step.sub, step.at, step.along, step.x, step.d);
      if (alpha == 0.0) break;
      step.x.all += alpha * step.d.all;
      step.at.evaluate(step.problem, step.x);
      residual(step.sub, step.at, step.x, step.r);
      ASSERT_TRUE(step.newton.factor(step.sub, step.x, 1e-6, true));
      EXPECT_TRUE(step.newton.direction(step.sub, step.x, step.r, step.d, step.along));
    }
    EXPECT_LT(max_abs(step.r.all), 1e-6) << seed;
  }
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
