// What others rely on of the active set: the exact solution of a branch or a no, at no more factorizations
// than allowed, and the elastic one.
#include "active_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>

#include "support/branch.h"
#include "support/brute_force.h"
#include "support/random_problem.h"
#include "support/small_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Rows;
using testing::Workbench;

constexpr int kBudget = 100;

void choose(ActiveSet& engine, unsigned left_fixed) {
  WorkingSet set = engine.set();
  for (Index pair = 0; pair < set.layout.pairs; ++pair)
    set.fix(pair, (left_fixed >> pair & 1U) != 0, set.held[set.free_row(pair)] != 0);
  engine.set_working_set(set);
}

Options unscaled() {
  Options options;
  options.scaling_passes = 0;
  return options;
}

// One variable z ≥ 1 and a pair 0 ≤ x ⊥ y ≥ 0, unscaled: (x, y, z).
OwnedProblem row_and_pair() {
  OwnedProblem p;
  p.g = {0.0, 0.0, 0.0};
  p.Q = compress(3, 3, {{0, 1, 2}, {0, 1, 2}, {1.0, 1.0, 1.0}}, "Q").value();
  p.C = compress(1, 3, {{0}, {2}, {1.0}}, "C").value();
  p.d = {-1.0};
  p.L = compress(1, 3, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 3, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

void expect_optimal(const Workbench& w, const ActiveSet& engine, const std::string& what) {
  constexpr double kSign = 1e-7;
  const Images images = w.images(engine.x());
  const WorkingSet& set = engine.set();
  EXPECT_LE(engine.error(), 1e-9) << what;
  EXPECT_LE(max_abs(images.stationarity), 1e-9) << what;
  EXPECT_LE(max_abs(images.equality), 1e-9) << what;
  for (Index i = 0; i < set.layout.inequalities; ++i) {
    EXPECT_GE(images.rows.inequality()[i], -1e-9) << what;
    EXPECT_LE(engine.x().lambda_w()[i], kSign) << what;
    EXPECT_NEAR(set.held[i] ? images.rows.inequality()[i] : engine.x().lambda_w()[i], 0.0, 1e-9);
  }
  for (Index i = 0; i < set.layout.pairs; ++i) {
    const bool left = set.left_fixed[i] != 0;
    EXPECT_NEAR(left ? images.rows.left()[i] : images.rows.right()[i], 0.0, 1e-9)
        << what << ": the fixed side";
    const double free = left ? images.rows.right()[i] : images.rows.left()[i];
    const double multiplier = left ? engine.x().lambda_R()[i] : engine.x().lambda_L()[i];
    EXPECT_GE(free, -1e-9) << what;
    EXPECT_LE(multiplier, kSign) << what << ": only a fixed side may pull";
    EXPECT_NEAR(set.held[set.free_row(i)] ? free : multiplier, 0.0, 1e-9) << what;
  }
}

TEST(ActiveSet, SolvesEveryBranchExactlyOrSaysThatItIsEmpty) {
  int solved = 0;
  int empty = 0;
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 8, .equalities = 2, .inequalities = 5, .pairs = 3}, seed);
    for (unsigned left_fixed = 0; left_fixed < 8; ++left_fixed) {
      const std::string what = p.name + " branch " + std::to_string(left_fixed);
      const auto best = testing::brute_force(testing::branch(p, left_fixed).view());
      Workbench w(p);
      ActiveSet engine(w.problem, *w.kkt);
      choose(engine, left_fixed);
      ASSERT_EQ(engine.solve(w.run, kBudget), best.has_value()) << what;
      EXPECT_LE(w.run.factorizations, kBudget) << what;
      if (!best) {
        ++empty;
        continue;
      }
      ++solved;
      expect_optimal(w, engine, what);
      EXPECT_NEAR(w.judged(engine.x().z()).objective, best->objective,
                  1e-6 * (1.0 + std::abs(best->objective)))
          << what;
    }
  }
  EXPECT_GT(solved, 50);
  EXPECT_GT(empty, 10);
}

TEST(ActiveSet, SolvesDegenerateBranchesAsWell) {
  for (const auto& problems : {testing::small_problems(), testing::known_problems()}) {
    for (const auto& [problem, optimum] : problems) {
      if (problem.l.size() > 5) continue;
      double lowest = std::numeric_limits<double>::infinity();
      for (unsigned left_fixed = 0; left_fixed < 1U << problem.l.size(); ++left_fixed) {
        Workbench w(problem);
        ActiveSet engine(w.problem, *w.kkt);
        choose(engine, left_fixed);
        if (!engine.solve(w.run, kBudget)) continue;
        expect_optimal(w, engine, problem.name);
        lowest = std::min(lowest, w.judged(engine.x().z()).objective);
      }
      EXPECT_NEAR(lowest, optimum, 1e-8 * (1.0 + std::abs(optimum))) << problem.name << ": the best branch";
    }
  }
}

TEST(ActiveSet, NeverTakesMoreFactorizationsThanItMay) {
  int short_of = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 16, .equalities = 2, .inequalities = 20, .pairs = 4}, seed);
    for (int budget = 0; budget <= 8; ++budget) {
      Workbench w(p);
      ActiveSet engine(w.problem, *w.kkt);
      choose(engine, 5);
      w.run.factorizations = 1000;  // of engines before
      const bool solved = engine.solve(w.run, budget);
      EXPECT_LE(w.run.factorizations, 1000 + budget) << p.name;
      short_of += solved ? 0 : 1;
      Workbench soft(p);
      ActiveSet elastic(soft.problem, *soft.kkt);
      elastic.start_from_point(soft.zero());
      static_cast<void>(elastic.relax(soft.run, 1e4, false, budget));
      EXPECT_LE(soft.run.factorizations, budget + 1) << "one more where the factor at hand is another's";
    }
  }
  EXPECT_GT(short_of, 20);
}

TEST(ActiveSet, DoesNothingForWhoIsToStop) {
  Rows rows;
  rows.source.request_stop();
  Workbench w(testing::random_problem({}, 1), {}, &rows);
  ActiveSet engine(w.problem, *w.kkt);
  engine.start_from_point(w.zero());
  EXPECT_FALSE(engine.solve(w.run, kBudget));
  EXPECT_FALSE(engine.relax(w.run, 1e3, false, kBudget));
  EXPECT_EQ(w.run.factorizations, 0);
}

TEST(ActiveSet, ReadsABranchOffAPathPoint) {
  Workbench w(row_and_pair(), unscaled());
  ActiveSet engine(w.problem, *w.kkt);
  Iterate x(w.problem);
  x.z() << 0.1, 2.0, 1.5;
  x.v()[0] = 0.5;
  x.lambda_w()[0] = -0.3;
  x.lambda_L()[0] = 0.7;
  x.lambda_R()[0] = -0.2;
  engine.start_from_path(x);
  EXPECT_EQ(engine.set().left_fixed[0], 1) << "x < y";
  EXPECT_EQ(engine.set().held[0], 0) << "v > 0";
  EXPECT_EQ(engine.set().held[engine.set().free_row(0)], 0) << "y is larger than its multiplier";
  EXPECT_EQ(engine.x().lambda_w()[0], 0.0) << "what is not active has no multiplier";
  EXPECT_EQ(engine.x().lambda_R()[0], 0.0);
  EXPECT_EQ(engine.x().lambda_L()[0], 0.7) << "that of a fixed side stays";
  EXPECT_EQ(engine.x().z(), x.z());
  x.z() << 2.0, 0.1, 1.5;
  x.v()[0] = -0.5;
  x.lambda_L()[0] = -3.0;
  engine.start_from_path(x);
  EXPECT_EQ(engine.set().left_fixed[0], 0);
  EXPECT_EQ(engine.set().held[0], 1);
  EXPECT_EQ(engine.set().held[engine.set().free_row(0)], 1) << "x = 2 against its multiplier 3";
}

TEST(ActiveSet, ReadsABranchOffASolutionOfAnotherProblem) {
  Workbench w(row_and_pair(), unscaled());
  ActiveSet engine(w.problem, *w.kkt);
  Iterate x(w.problem);
  x.z() << 0.4, 0.5, 1.01;  // sides that are both off zero: the multipliers tell
  x.lambda_w()[0] = -0.5;
  x.lambda_L()[0] = 0.1;
  x.lambda_R()[0] = -2.0;
  engine.start_from_solution(x);
  EXPECT_EQ(engine.set().left_fixed[0], 0) << "y − |η| < x − |ξ|";
  EXPECT_EQ(engine.set().held[0], 1) << "slack 0.01 against multiplier 0.5";
  EXPECT_EQ(engine.set().held[engine.set().free_row(0)], 0);
  x.lambda_L()[0] = -0.45;
  x.lambda_R()[0] = 0.1;
  x.z()[2] = 2.0;
  engine.start_from_solution(x);
  EXPECT_EQ(engine.set().left_fixed[0], 1);
  EXPECT_EQ(engine.set().held[0], 0);
}

TEST(ActiveSet, ReadsABranchOffAPoint) {
  Workbench w(row_and_pair(), unscaled());
  ActiveSet engine(w.problem, *w.kkt);
  const Eigen::Vector3d left(0.1, 0.2, 0.0), right(0.3, 0.2, 0.0);
  engine.start_from_point(left);
  EXPECT_EQ(engine.set().left_fixed[0], 1);
  engine.start_from_point(right);
  EXPECT_EQ(engine.set().left_fixed[0], 0);
  EXPECT_EQ(engine.x().z(), right);
}

TEST(ActiveSet, FromAnExactSolutionItIsThereAfterOneFactorization) {
  int read = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    ActiveSet engine(w.problem, *w.kkt);
    engine.start_from_point(w.zero());
    if (!engine.solve(w.run, kBudget)) continue;
    const Iterate x = engine.x();
    const WorkingSet set = engine.set();
    int before = w.run.factorizations;
    const auto both_held = [&set](Index pair) { return set.held[set.free_row(pair)] != 0; };
    if (std::ranges::none_of(std::views::iota(0, set.layout.pairs), both_held)) {  // else either side may be
      ++read;
      engine.start_from_solution(x);
      EXPECT_TRUE(engine.set() == set) << seed;
      ASSERT_TRUE(engine.solve(w.run, kBudget));
      EXPECT_EQ(w.run.factorizations - before, 1) << seed;
    }
    // Elsewhere, and back.
    choose(engine, 10);
    static_cast<void>(engine.solve(w.run, kBudget));
    engine.restore(x, set);
    EXPECT_EQ(engine.x().all, x.all);
    EXPECT_TRUE(engine.set() == set);
    EXPECT_EQ(engine.images().objective, w.images(x).objective) << "images are those of the point";
    EXPECT_LE(engine.error(), 1e-9);
    before = w.run.factorizations;
    ASSERT_TRUE(engine.solve(w.run, kBudget));
    EXPECT_EQ(w.run.factorizations - before, 1) << seed;
    EXPECT_LE(max_abs(engine.x().z() - x.z()), 1e-9) << seed;
  }
  EXPECT_GE(read, 10);
}

// The elastic objective in plain loops: f + ½δ‖z − anchor‖² + ½ρ Σ violation², with δ as relax() has it.
double elastic(const Workbench& w, const WorkingSet& set, double rho, const Vector& anchor, const Vector& z) {
  Iterate x(w.problem);
  x.z() = z;
  const Images images = w.images(x);
  double violation = images.equality.squaredNorm();
  const auto below = [](double value) { return std::min(0.0, value) * std::min(0.0, value); };
  for (const double value : images.rows.inequality()) violation += below(value);
  for (Eigen::Index i = 0; i < images.rows.left().size(); ++i) {
    const bool left = set.left_fixed[static_cast<std::size_t>(i)] != 0;
    violation += left ? images.rows.left()[i] * images.rows.left()[i] + below(images.rows.right()[i])
                      : images.rows.right()[i] * images.rows.right()[i] + below(images.rows.left()[i]);
  }
  const double delta = rho >= 1e8 ? 1e-8 : 1e-6;
  return images.objective + 0.5 * delta * (z - anchor).squaredNorm() + 0.5 * rho * violation;
}

TEST(ActiveSet, TheElasticSolutionIsTheMinimumOfItsPenaltyFunction) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    ActiveSet engine(w.problem, *w.kkt);
    engine.start_from_point(w.zero());
    for (const double rho : {10.0, 1e3, 1e6}) {
      ASSERT_TRUE(engine.relax(w.run, rho, false, kBudget)) << seed;
      EXPECT_EQ(engine.rho(), rho);
      const Vector z = engine.x().z();
      const double least = elastic(w, engine.set(), rho, w.zero(), z);
      EXPECT_NEAR(engine.elastic_objective(), least, 1e-8 * (1.0 + std::abs(least))) << seed;
      for (Index k = 0; k < w.problem.variables(); ++k) {
        for (const double step : {1e-3, -1e-3}) {
          const Vector near = z + step * Vector::Unit(z.size(), k);
          EXPECT_GE(elastic(w, engine.set(), rho, w.zero(), near), least - 1e-10) << seed << " rho " << rho;
        }
      }
      const Images images = w.images(engine.x());
      EXPECT_LE(max_abs(engine.x().y() - rho * images.equality), 1e-7 * rho) << "λ = ρ · violation";
    }
  }
}

TEST(ActiveSet, AStifferElasticProblemCostsMoreAndEndsAtTheExactOne) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    ActiveSet engine(w.problem, *w.kkt);
    engine.start_from_point(w.zero());
    const WorkingSet branch = engine.set();
    double before = -std::numeric_limits<double>::infinity();
    for (const double rho : {1.0, 10.0, 1e3, 1e5, 1e8}) {
      ASSERT_TRUE(engine.relax(w.run, rho, false, kBudget));
      EXPECT_GE(engine.elastic_objective(), before - 1e-7 * (1.0 + std::abs(before))) << seed;
      before = engine.elastic_objective();
    }
    EXPECT_EQ(engine.set().left_fixed, branch.left_fixed) << "sides never change by themselves";
    if (!engine.solve(w.run, kBudget)) continue;
    const double exact = engine.images().objective;
    EXPECT_NEAR(before, exact, 1e-3 * (1.0 + std::abs(exact))) << seed;
    EXPECT_LE(before, exact + 1e-6 * (1.0 + std::abs(exact))) << seed;
  }
}

TEST(ActiveSet, WhereItIsAnchoredVariablesWithoutCostStay) {
  OwnedProblem p = row_and_pair();
  p.Q = compress(3, 3, {{0, 1}, {0, 1}, {1.0, 1.0}}, "Q").value();
  Workbench w(p);
  ActiveSet engine(w.problem, *w.kkt);
  Vector z = w.zero();
  z[2] = 5.0 / w.problem.variable_scale[2];
  engine.start_from_point(z);
  engine.anchor_here();
  ASSERT_TRUE(engine.relax(w.run, 1e3, false, kBudget));
  EXPECT_NEAR(w.user(engine.x().z())[2], 5.0, 1e-6);
  engine.anchor_at_zero();
  ASSERT_TRUE(engine.relax(w.run, 1e3, false, kBudget));
  EXPECT_LE(w.user(engine.x().z())[2], 1.0 + 1e-6) << "to 0 as far as z ≥ 1 lets it";
}

TEST(ActiveSet, AFactorTellsNegativeCurvatureThatNoRowHolds) {
  OwnedProblem p = row_and_pair();
  p.Q = compress(3, 3, {{0, 1, 2}, {0, 1, 2}, {1.0, 1.0, -1.0}}, "Q").value();
  Workbench w(p);
  ActiveSet engine(w.problem, *w.kkt);
  EXPECT_FALSE(engine.factor(w.run, tuning::exact_rho, tuning::exact_delta));
  WorkingSet set = engine.set();
  set.held[0] = 1;
  engine.set_working_set(set);
  EXPECT_TRUE(engine.factor(w.run, tuning::exact_rho, tuning::exact_delta));
  EXPECT_EQ(w.run.factorizations, 2);
  engine.set_working_set(WorkingSet(w.problem));
  EXPECT_FALSE(engine.solve(w.run, kBudget)) << "without a minimum there is no solution";
}

TEST(ActiveSet, WithAFactorItProjectsAndSharpens) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    ActiveSet engine(w.problem, *w.kkt);
    engine.start_from_point(w.zero());
    if (!engine.solve(w.run, kBudget)) continue;
    const Vector solution = engine.x().z();
    ASSERT_TRUE(engine.factor(w.run, tuning::exact_rho, tuning::exact_delta));
    Vector direction = Vector::LinSpaced(w.problem.variables(), -1.0, 2.0);
    ASSERT_TRUE(engine.project(direction));
    Images along(w.problem);
    along.evaluate_rows(w.problem, direction);
    EXPECT_LE(max_abs(along.equality), 1e-6) << seed;
    for (std::size_t k = 0; k < engine.set().left_fixed.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      EXPECT_NEAR(engine.set().left_fixed[k] ? along.rows.left()[i] : along.rows.right()[i], 0.0, 1e-6)
          << seed;
    }
    Iterate x = engine.x();
    x.z() += 1e-3 * Vector::Ones(x.z().size());
    engine.restore(x, engine.set());
    ASSERT_TRUE(engine.sharpen());
    EXPECT_LE(max_abs(engine.x().z() - solution), 1e-9) << seed;
  }
}

// Every solution falls short by two fifths: a few sweeps gain a few digits, no more.
class ShortKkt final : public testing::WrappedKkt {
 public:
  using WrappedKkt::WrappedKkt;
  [[nodiscard]] bool solve(VectorRef x, VectorRef y) override {
    const bool solved = WrappedKkt::solve(x, y);
    x *= 0.6;
    y *= 0.6;
    return solved;
  }
};

TEST(ActiveSet, CallsSolvedOnlyWhatIsExact) {
  int refused = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Workbench w(testing::random_problem({.variables = 12, .inequalities = 0}, seed));
    ShortKkt kkt(*w.kkt);
    ActiveSet engine(w.problem, kkt);
    engine.start_from_point(w.zero());
    const bool solved = engine.solve(w.run, kBudget);
    EXPECT_TRUE(!solved || engine.error() <= 1e-9) << seed << ": " << engine.error();
    refused += solved ? 0 : 1;
  }
  EXPECT_GE(refused, 10);
}

}  // namespace
}  // namespace marble
