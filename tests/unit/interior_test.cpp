// What others rely on of the interior point method: a point whose branch is near a feasible branch, at a
// bounded number of factorizations.
#include "path/interior.h"

#include <gtest/gtest.h>

#include <cmath>

#include "branch/branch_engines.h"
#include "marble/examples.h"
#include "row_parts.h"
#include "support/random_problem.h"
#include "support/small_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Rows;
using testing::Workbench;

constexpr int kMostSteps = 100;

TEST(InteriorEngine, OfAConvexProblemWithoutPairsItFindsTheOptimum) {
  for (const auto& [problem, optimum] : testing::small_problems()) {
    if (!problem.l.empty()) continue;
    Workbench w(problem);
    InteriorEngine engine(w.problem, *w.kkt);
    ASSERT_TRUE(engine.run(w.run, w.zero())) << problem.name;
    const testing::Verdict verdict = w.judged(engine.z());
    EXPECT_LE(verdict.infeasibility(), 1e-4) << problem.name;
    EXPECT_NEAR(verdict.objective, optimum, 1e-3 * (1.0 + std::abs(optimum))) << problem.name;
  }
}

TEST(InteriorEngine, EndsWithEverySideAtZeroOrNearIt) {
  const auto problems = testing::known_problems();
  int near = 0;
  int solvable = 0;
  for (const auto& [problem, optimum] : problems) {
    Workbench w(problem);
    InteriorEngine engine(w.problem, *w.kkt);
    if (!engine.run(w.run, w.zero())) continue;
    near += w.judged(engine.z()).infeasibility() <= 1e-2 ? 1 : 0;
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.start_from_point(engine.z());
    solvable += branch.exact.solve(w.run, 100) ? 1 : 0;
  }
  EXPECT_GE(near, 27) << "of " << problems.size();
  EXPECT_GE(solvable, 27) << "the smaller side of every pair is a feasible branch";
}

// s∘t = κ holds for the engine's own s and t; the point's sides are theirs once the primal residual is gone.
// Where branches are narrow it stays at a larger κ: its last hundred steps are not promised to be enough.
TEST(InteriorEngine, FollowsSTimesTEqualKappaDownToTheLastKappaOrStaysAtAnEarlierOne) {
  int on_the_curve = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Rows rows(true);
    Workbench w(testing::random_problem({.variables = 20, .equalities = 2, .inequalities = 4}, seed), {},
                &rows);
    InteriorEngine engine(w.problem, *w.kkt);
    ASSERT_TRUE(engine.run(w.run, w.zero())) << seed;
    for (std::size_t i = 1; i < rows.rows.size(); ++i)
      EXPECT_LE(rows.rows[i].kappa, rows.rows[i - 1].kappa) << seed;
    double largest = rows.rows.back().kkt_residual;
    for (std::size_t pair = 0; pair < rows.s.back().size(); ++pair) {
      const auto i = static_cast<Eigen::Index>(pair);
      const double s = rows.s.back()[pair] * left_scale_of(w.problem)[i];
      const double t = rows.t.back()[pair] * right_scale_of(w.problem)[i];
      largest = std::max({largest, -s, -t, s * t});
    }
    if (largest <= 1e-5 && rows.rows.back().kappa <= 1e-6) ++on_the_curve;
  }
  EXPECT_GE(on_the_curve, 24) << "of 60";
}

TEST(InteriorEngine, CostsAFactorizationAStepAndAHundredAtMost) {
  for (const OwnedProblem& p :
       {examples::gates({.steps = 10}), examples::rocket(), testing::without_feasible_branch()}) {
    Workbench w(p);
    InteriorEngine engine(w.problem, *w.kkt);
    static_cast<void>(engine.run(w.run, w.zero()));
    EXPECT_LE(w.run.factorizations, kMostSteps) << p.name;
    EXPECT_LE(w.run.factorizations - w.run.iterations, 1) << p.name << ": the last may have been of no use";
    EXPECT_GT(w.run.iterations, 5) << p.name;
    EXPECT_TRUE(engine.z().allFinite()) << p.name;
  }
}

TEST(InteriorEngine, ReportsEveryStepAndBeginsWhereItIsReported) {
  Rows rows;
  Workbench w(examples::rocket(), {}, &rows);
  InteriorEngine engine(w.problem, *w.kkt);
  const Vector z = Vector::LinSpaced(w.problem.variables(), -0.5, 0.5);
  ASSERT_TRUE(engine.run(w.run, z));
  EXPECT_EQ(rows.z.front(), w.user(z));
  ASSERT_EQ(rows.rows.size(), static_cast<std::size_t>(w.run.iterations) + 1);
  EXPECT_EQ(rows.z.back(), w.user(engine.z()));
  for (std::size_t i = 0; i < rows.rows.size(); ++i) EXPECT_EQ(rows.rows[i].iteration, static_cast<int>(i));
}

TEST(InteriorEngine, IsFalseWhereItIsInterrupted) {
  for (const int row : {1, 4}) {
    Rows rows;
    rows.stop_after = row;
    Workbench w(examples::rocket(), {}, &rows);
    InteriorEngine engine(w.problem, *w.kkt);
    EXPECT_FALSE(engine.run(w.run, w.zero()));
    EXPECT_LE(w.run.iterations, row);
  }
  Options options;
  options.max_iterations = 3;
  Workbench w(examples::rocket(), options);
  InteriorEngine engine(w.problem, *w.kkt);
  EXPECT_FALSE(engine.run(w.run, w.zero()));
  EXPECT_EQ(w.run.iterations, 3);
}

TEST(InteriorEngine, ThatBreaksDownOnItsWayHasSomethingToShowUnlessItWasStopped) {
  for (const bool stopped : {false, true}) {
    Rows rows;
    Workbench w(examples::rocket(), {}, &rows);
    testing::FailingKkt failing(*w.kkt, 8, stopped ? &rows.source : nullptr);
    InteriorEngine engine(w.problem, failing);
    EXPECT_EQ(engine.run(w.run, w.zero()), !stopped);
    EXPECT_EQ(w.run.iterations, 7);
    EXPECT_TRUE(engine.z().allFinite());
  }
}

TEST(InteriorEngine, IsFalseWhereItsFirstFactorizationIsOfNoUse) {
  OwnedProblem p;  // −½(Σz)²: far from convex, whatever the proximal term
  p.g.assign(12, 0.0);
  Triplets entries;
  for (Index i = 0; i < 12; ++i) {
    for (Index j = 0; j < 12; ++j) entries.add(i, j, -1.0);
  }
  p.Q = compress(12, 12, entries, "Q").value();
  Workbench w(p);
  InteriorEngine engine(w.problem, *w.kkt);
  EXPECT_FALSE(engine.run(w.run, w.zero()));
  EXPECT_EQ(w.run.factorizations, 1);
  EXPECT_EQ(w.run.iterations, 0);
}

TEST(InteriorEngine, ARunBeforeLeavesNoTrace) {
  Workbench w(examples::rocket());
  InteriorEngine engine(w.problem, *w.kkt);
  ASSERT_TRUE(engine.run(w.run, w.zero()));
  const Vector first = engine.z();
  const int factorizations = w.run.factorizations;
  static_cast<void>(engine.run(w.run, Vector::Constant(w.problem.variables(), 0.4)));
  const int before = w.run.factorizations;
  ASSERT_TRUE(engine.run(w.run, w.zero()));
  EXPECT_EQ(engine.z(), first);
  EXPECT_EQ(w.run.factorizations - before, factorizations);
}

}  // namespace
}  // namespace marble
