// What others rely on of the path: where it ends, what it keeps on the way, and that it can be stopped, gone
// on with and begun again.
#include "path/path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "marble/examples.h"
#include "support/random_problem.h"
#include "support/small_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Rows;
using testing::Workbench;

Options on(Path path) {
  Options options;
  options.path = path;
  return options;
}

TEST(PathEngine, CallsSolvedOnlyWhatIsFeasibleAndStationary) {
  int solved = 0;
  for (const Path path : {Path::fast, Path::paper}) {
    for (const auto& [problem, optimum] : testing::known_problems()) {
      Workbench w(problem, on(path));
      PathEngine engine(w.problem, *w.kkt, w.options);
      engine.start(w.zero());
      const auto end = engine.follow(w.run, w.options.kappa_min);
      ASSERT_TRUE(end.has_value()) << problem.name << ": at the last κ there is nothing to come back for";
      if (end->status != Status::solved) continue;
      ++solved;
      EXPECT_LE(w.judged(engine.iterate().z()).infeasibility(), 1e-6) << problem.name;
      EXPECT_LE(max_abs(w.images(engine.iterate()).stationarity), 1e-6) << problem.name;
      EXPECT_LE(largest(engine.violations_at()), 1e-6) << problem.name;
      EXPECT_NEAR(engine.objective(), w.images(engine.iterate()).objective, 1e-9 * (1.0 + std::abs(optimum)));
      EXPECT_GE(w.judged(engine.iterate().z()).objective, optimum - 1e-4 * (1.0 + std::abs(optimum)));
    }
  }
  EXPECT_GE(solved, 54) << "of 60";
}

// (4) by construction, and L z + l = p(σ), R z + r = p(−σ) up to the residual.
TEST(PathEngine, AtTheEndOfAnInnerLoopTheSidesOfEveryPairAreOnTheCurveOfItsKappa) {
  for (const Path path : {Path::fast, Path::paper}) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      Options options = on(path);
      options.inner_tolerance = 1e-9;
      Rows rows;
      Workbench w(testing::random_problem({}, seed), options, &rows);
      PathEngine engine(w.problem, *w.kkt, w.options);
      engine.start(w.zero());
      if (engine.follow(w.run, 1e-2)) continue;
      const double kappa = rows.rows.back().kappa;
      const double residual = rows.rows.back().kkt_residual;
      EXPECT_LE(kappa, 1e-2);
      EXPECT_GT(kappa, 1e-3) << "no further than asked for";
      const Images images = w.images(engine.iterate());
      for (Eigen::Index i = 0; i < images.rows.s().size(); ++i) {
        // A residual ρ₅ moves a side by ρ₅ + |λ − β|/ρ; both shrink together.
        const double slack =
            10.0 * residual * (1.0 + std::abs(images.rows.s()[i]) + std::abs(images.rows.t()[i]));
        EXPECT_NEAR(images.rows.s()[i] * images.rows.t()[i], kappa, slack + 1e-6) << seed << " pair " << i;
        EXPECT_GT(images.rows.s()[i], -residual - 1e-6);
        EXPECT_GT(images.rows.t()[i], -residual - 1e-6);
      }
    }
  }
}

TEST(PathEngine, InTwoPartsItIsTheSamePath) {
  for (const Path path : {Path::fast, Path::paper}) {
    int parts = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const OwnedProblem p = testing::random_problem({}, seed);
      Rows in_parts, whole;
      Workbench a(p, on(path), &in_parts), b(p, on(path), &whole);
      PathEngine first(a.problem, *a.kkt, a.options), second(b.problem, *b.kkt, b.options);
      first.start(a.zero());
      std::optional<Ending> end = first.follow(a.run, 1e-2);
      for (const double kappa_end : {1e-6, a.options.kappa_min}) {
        if (end || first.is_lost()) break;
        ++parts;
        end = first.follow(a.run, kappa_end);
      }
      if (!end) continue;  // lost: with other engines to try it gives up earlier
      second.start(b.zero());
      const auto same = second.follow(b.run, b.options.kappa_min);
      ASSERT_TRUE(same.has_value());
      EXPECT_EQ(end->status, same->status) << p.name;
      EXPECT_EQ(first.iterate().all, second.iterate().all) << p.name;
      EXPECT_EQ(a.run.factorizations, b.run.factorizations) << p.name;
      EXPECT_EQ(in_parts.rows.size(), whole.rows.size()) << "where it goes on nothing is reported twice";
    }
    EXPECT_GE(parts, 15);
  }
}

TEST(PathEngine, AStartForgetsThePathBeforeAndALean) {
  const OwnedProblem p = examples::hopper({.steps = 6});
  Workbench w(p), fresh(p);
  PathEngine engine(w.problem, *w.kkt, w.options), other(fresh.problem, *fresh.kkt, fresh.options);
  other.start(fresh.zero());
  const auto expected = other.follow(fresh.run, 1e-2);
  engine.start(Vector::Constant(w.problem.variables(), 0.3));
  static_cast<void>(engine.follow(w.run, 1e-6));
  engine.lean(w.run, w.zero(), 10.0);
  engine.start(w.zero());
  const int before = w.run.factorizations;
  const auto again = engine.follow(w.run, 1e-2);
  EXPECT_EQ(again.has_value(), expected.has_value());
  EXPECT_EQ(engine.iterate().all, other.iterate().all);
  EXPECT_EQ(engine.best().all, other.best().all);
  EXPECT_EQ(w.run.factorizations - before, fresh.run.factorizations);
}

TEST(PathEngine, BeginsWhereItIsReported) {
  Rows rows;
  Workbench w(testing::random_problem({}, 2), {}, &rows);
  PathEngine engine(w.problem, *w.kkt, w.options);
  const Vector z = Vector::LinSpaced(w.problem.variables(), -1.0, 1.0);
  engine.start(z);
  EXPECT_EQ(engine.iterate().z(), z);
  static_cast<void>(engine.follow(w.run, 1e-2));
  EXPECT_EQ(rows.z.front(), w.user(z));
  EXPECT_EQ(rows.rows.front().step_length, 0.0) << "before the first step";
}

TEST(PathEngine, KappaAndRhoMoveOneWayUnlessItRetreats) {
  for (const auto& [problem, optimum] : testing::known_problems()) {
    Rows rows;
    Workbench w(problem, on(Path::paper), &rows);
    PathEngine engine(w.problem, *w.kkt, w.options);
    engine.start(w.zero());
    static_cast<void>(engine.follow(w.run, w.options.kappa_min));
    for (std::size_t i = 1; i < rows.rows.size(); ++i) {
      EXPECT_LE(rows.rows[i].kappa, rows.rows[i - 1].kappa) << problem.name;
      EXPECT_GE(rows.rows[i].rho, rows.rows[i - 1].rho) << problem.name;
      EXPECT_EQ(rows.rows[i].iteration, rows.rows[i - 1].iteration + 1) << problem.name;
    }
    EXPECT_GE(rows.rows.back().kappa, w.options.kappa_min);
  }
}

TEST(PathEngine, WhereItIsInterruptedItGivesTheLeastViolatedIterate) {
  const OwnedProblem p = examples::hopper({.steps = 8});
  for (const int limit : {0, 1, 5, 9, 11}) {
    Options options;
    options.max_iterations = limit;
    Rows rows;
    Workbench w(p, options, &rows);
    PathEngine engine(w.problem, *w.kkt, w.options);
    engine.start(w.zero());
    const auto end = engine.follow(w.run, w.options.kappa_min);
    ASSERT_TRUE(end.has_value());
    EXPECT_EQ(end->status, Status::iteration_limit);
    EXPECT_EQ(w.run.iterations, limit);
    double least = std::numeric_limits<double>::infinity();
    for (const Progress& row : rows.rows) least = std::min(least, largest(row.violations));
    EXPECT_EQ(largest(engine.violations_at()), least) << limit;
    EXPECT_EQ(largest(engine.best_violations()), least) << limit;
    EXPECT_EQ(engine.objective(), w.images(engine.iterate()).objective) << limit;
    EXPECT_NEAR(w.judged(engine.iterate().z()).infeasibility(), least, 1e-9 * (1.0 + least)) << limit;
  }
}

TEST(PathEngine, HearsAStopAfterTheRowThatAskedForIt) {
  for (const int row : {1, 2, 7}) {
    Rows rows;
    rows.stop_after = row;
    Workbench w(examples::hopper({.steps = 8}), {}, &rows);
    PathEngine engine(w.problem, *w.kkt, w.options);
    engine.start(w.zero());
    const auto end = engine.follow(w.run, w.options.kappa_min);
    ASSERT_TRUE(end.has_value());
    EXPECT_EQ(end->status, Status::cancelled);
    EXPECT_EQ(w.run.iterations, row - 1);
    EXPECT_EQ(rows.rows.size(), static_cast<std::size_t>(row));
  }
}

TEST(PathEngine, WhereItIsLostItSaysSoAfterBoundedWork) {
  Workbench w(testing::without_feasible_branch());
  PathEngine engine(w.problem, *w.kkt, w.options);
  engine.start(w.zero());
  const auto end = engine.follow(w.run, 1e-6);
  EXPECT_TRUE(engine.is_lost() || (end && end->status != Status::solved));
  EXPECT_LE(w.run.iterations, 60) << "15 steps at one κ, 25 at the first";
  const auto last = engine.follow(w.run, w.options.kappa_min);
  ASSERT_TRUE(last.has_value());
  EXPECT_FALSE(is_solved(last->status)) << last->detail;
  EXPECT_LE(w.run.iterations, 1000) << "four times as many, and each retreat the same again";
  EXPECT_GT(largest(engine.violations_at()), 1e-2) << "min(x, y) of x, y ≥ 1";
}

TEST(PathEngine, MarksTheRunWhereQHasNegativeCurvatureAndOnlyThere) {
  for (const bool indefinite : {false, true}) {
    int marked = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      Options options;
      options.max_iterations = 60;
      Workbench w(testing::random_problem({.indefinite = indefinite}, seed), options);
      PathEngine engine(w.problem, *w.kkt, w.options);
      engine.start(w.zero());
      static_cast<void>(engine.follow(w.run, w.options.kappa_min));
      marked += w.run.nonconvex ? 1 : 0;
    }
    EXPECT_EQ(marked > 0, indefinite) << marked;
  }
}

// min 2(x − 1)² + (y − 3)² over 0 ≤ x ⊥ y ≥ 0: soft, both are large; y has more to lose.
TEST(PathEngine, ALeanTakesFewStepsAndLeansToTheSideThatCostsLess) {
  OwnedProblem p;
  p.g = {-4.0, -6.0};
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {4.0, 2.0}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  Rows rows;
  Workbench w(p, {}, &rows);
  PathEngine engine(w.problem, *w.kkt, w.options);
  engine.lean(w.run, w.zero(), 10.0);
  const std::vector<double> z = w.user(engine.iterate().z());
  EXPECT_LT(z[0], z[1]);
  EXPECT_NEAR(z[1], 3.0, 0.5);
  EXPECT_LE(w.run.iterations, 3 * 7) << "seven ρ from 1e-3 to 10 by 4";
  for (std::size_t i = 1; i < rows.rows.size(); ++i) {
    EXPECT_EQ(rows.rows[i].kappa, rows.rows[0].kappa) << "κ stays";
    EXPECT_GE(rows.rows[i].rho, rows.rows[i - 1].rho);
    EXPECT_LT(rows.rows[i].rho, 4.0 * 10.0);
  }
}

TEST(PathEngine, ALeanHearsAStop) {
  Rows rows;
  rows.stop_after = 2;
  Workbench w(examples::hopper({.steps = 8}), {}, &rows);
  PathEngine engine(w.problem, *w.kkt, w.options);
  engine.lean(w.run, w.zero(), 10.0);
  EXPECT_EQ(w.run.iterations, 1);
}

}  // namespace
}  // namespace marble
