// Bounds that rows and pairs imply, beside solutions of an enumeration, which shares no code with them.
#include "global/implied_bounds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "marble/warm_solver.h"
#include "support/box_qp.h"
#include "support/brute_force.h"
#include "support/independent_check.h"
#include "support/problem_builder.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::ProblemBuilder;
using testing::Workbench;

// −4x + 1 − λ + μ = 0, 0 ≤ x ⊥ λ ≥ 0, 0 ≤ 1 − x ⊥ μ ≥ 0 in (x, λ, μ), cost ½(x − μ).
OwnedProblem one_variable() {
  return ProblemBuilder("one variable", {0.5, 0.0, -0.5})
      .equal({-4, -1, 1, 1})
      .pair({1, 0, 0, 0}, {0, 1, 0, 0})
      .pair({-1, 0, 0, 1}, {0, 0, 1, 0})
      .optimum(-1.0)
      .problem;
}

TEST(ImpliedBounds, ASideIsBoundedByWhatIsLeftWhenTheOtherOneIsZero) {
  const Workbench bench(one_variable());
  const ScaledProblem& p = bench.problem;
  ImpliedBounds implied(p, {});
  ASSERT_EQ(implied.probe({}), ImpliedBounds::End::bounded);
  const double expected[] = {1.0, 1.0, 1.0, 3.0};  // x, 1 − x, λ, μ
  for (Index row = 0; row < 4; ++row) EXPECT_NEAR(implied.most(row) / p.row_scale[row], expected[row], 1e-4);
}

TEST(ImpliedBounds, ARowOfBothSidesJoinsTheInequalities) {
  const Workbench bench(one_variable());
  ImpliedBounds implied(bench.problem, {});
  ASSERT_EQ(implied.probe({}), ImpliedBounds::End::bounded);
  const ScaledProblem stronger = implied.strengthened();
  ASSERT_EQ(stronger.inequalities(), 2);
  ASSERT_EQ(stronger.rows.rows, stronger.layout.size());
  // x + λ ≤ 1, and 1 − x + μ/3 ≤ 1: at the points of the branches, and beyond them.
  const auto slack = [&](std::vector<double> z, Index row) {
    const Vector scaled = Vector::Map(z.data(), 3).cwiseQuotient(stronger.variable_scale);
    return row_product(stronger.rows, row, scaled.data()) + stronger.offset[row];
  };
  for (const std::vector<double>& z : {std::vector<double>{0, 1, 0}, {1, 0, 3}, {0.25, 0, 0}}) {
    EXPECT_GE(slack(z, 0), 0.0);
    EXPECT_GE(slack(z, 1), 0.0);
  }
  EXPECT_LT(slack({0.5, 0.6, 1.6}, 0), 0.0);
  EXPECT_LT(slack({0.5, 0.0, 1.6}, 1), 0.0);
}

TEST(ImpliedBounds, ASideThatCannotBeZeroFixesTheOther) {
  const Workbench bench(ProblemBuilder("far from zero", {1, 1})
                            .at_least({1, 0, -2})
                            .pair({1, 0, 0}, {0, 1, 0})
                            .optimum(2)
                            .problem);
  ImpliedBounds implied(bench.problem, {});
  ASSERT_EQ(implied.probe({}), ImpliedBounds::End::bounded);
  EXPECT_EQ(implied.bounds().sides[0], Sides::t_zero);
}

TEST(ImpliedBounds, NeitherSideCanBeZero) {
  const Workbench bench(testing::without_feasible_branch());
  ImpliedBounds implied(bench.problem, {});
  EXPECT_EQ(implied.probe({}), ImpliedBounds::End::infeasible);
}

// A row violated by less than its tolerance proves nothing.
TEST(ImpliedBounds, HoldForPointsThatAreFeasibleToTheTolerances) {
  const auto nearly = [](double by) {
    return ProblemBuilder("nearly", {1, 1}).equal({1, 0, -1}).equal({1, 0, -1.0 - by}).optimum(1).problem;
  };
  const Workbench within(nearly(1.5e-6)), beyond(nearly(1e-5));
  EXPECT_EQ(ImpliedBounds(within.problem, {}).probe({}), ImpliedBounds::End::bounded);
  EXPECT_EQ(ImpliedBounds(beyond.problem, {}).probe({}), ImpliedBounds::End::infeasible);
}

OwnedProblem make(std::uint64_t seed) {
  testing::RandomSizes sizes;
  sizes.pairs = 1 + static_cast<Index>(seed % 5);
  sizes.variables = 2 + static_cast<Index>(seed % 4);
  sizes.equalities = static_cast<Index>(seed % 2);
  sizes.inequalities = 2 + static_cast<Index>(seed % 5);
  sizes.density = 0.4;
  OwnedProblem p = testing::random_problem(sizes, seed);
  std::mt19937_64 engine(seed);
  for (std::vector<double>* values : {&p.d, &p.l, &p.r}) {
    for (double& value : *values) value -= 0.001 * static_cast<double>(engine() % (seed % 3 * 400 + 1));
  }
  return p;
}

struct Seen {
  int infeasible = 0, points = 0, rows = 0, sides = 0;
};

// Points that are optimal for some objective, of all branches.
void expect_all_inside(OwnedProblem p, std::uint64_t seed, Seen& seen) {
  const Workbench bench(p);
  ImpliedBounds implied(bench.problem, {});
  const ImpliedBounds::End end = implied.probe({});
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> entry(-3.0, 3.0);
  const ScaledProblem stronger = end == ImpliedBounds::End::bounded ? implied.strengthened() : bench.problem;
  for (int objective = 0; objective < 12; ++objective) {
    const auto n = static_cast<Index>(p.g.size());
    Triplets identity;
    for (Index j = 0; j < n; ++j) identity.add(j, j, 0.1);
    p.Q = compress(n, n, identity, "Q").value();
    for (double& value : p.g) value = entry(engine);
    const auto best = testing::brute_force(p.view());
    if (end == ImpliedBounds::End::infeasible) {
      EXPECT_FALSE(best) << seed;
      ++seen.infeasible;
      return;
    }
    if (!best) return;
    ++seen.points;
    const Vector z = Vector::Map(best->z.data(), n).cwiseQuotient(bench.problem.variable_scale);
    for (Index j = 0; j < n; ++j) {
      EXPECT_GE(z[j], implied.bounds().lower[j]) << seed;
      EXPECT_LE(z[j], implied.bounds().upper[j]) << seed;
    }
    for (Index row = 0; row < stronger.layout.size(); ++row) {
      const double value = row_product(stronger.rows, row, z.data()) + stronger.offset[row];
      EXPECT_GE(value, -1e-7) << seed << " row " << row;
      if (!is_fixed(stronger.layout, implied.bounds().sides, row)) continue;
      EXPECT_LE(value, 1e-7) << seed << " row " << row;
      ++seen.sides;
    }
    seen.rows += stronger.inequalities() - bench.problem.inequalities();
  }
}

TEST(ImpliedBounds, BoundABoxQpAndNoProblemThatItsRowsBoundOrThatNothingBounds) {
  const auto only_pairs_bound = [](const OwnedProblem& p) {
    return ImpliedBounds::only_pairs_bound(Workbench(p).problem, {});
  };
  EXPECT_TRUE(only_pairs_bound(one_variable()));
  EXPECT_TRUE(only_pairs_bound(testing::box_qp(10, 1)));
  EXPECT_FALSE(only_pairs_bound(testing::row_and_pair()));
  EXPECT_FALSE(only_pairs_bound(ProblemBuilder("in a box", {1, 1})
                                    .at_least({-1, 0, 1})
                                    .at_least({0, -1, 1})
                                    .pair({1, 0, 0}, {0, 1, 0})
                                    .optimum(0)
                                    .problem));
}

TEST(ImpliedBounds, CutNoFeasiblePointOff) {
  Seen seen;
  for (std::uint64_t seed = 1; seed <= 600; ++seed) expect_all_inside(make(seed), seed, seen);
  for (std::uint64_t seed = 1; seed <= 12; ++seed)
    expect_all_inside(testing::box_qp(2 + static_cast<Index>(seed % 3), seed), seed, seen);
  EXPECT_GT(seen.infeasible, 0);
  EXPECT_GE(seen.points, 1000);
  EXPECT_GT(seen.rows, 0);
  EXPECT_GT(seen.sides, 0);
}

TEST(ImpliedBounds, LetATreeProveTheOptimumOfABoxQp) {
  Options options;
  options.global_search = true;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Index n = 4 + static_cast<Index>(seed % 3);
    const OwnedProblem p = testing::box_qp(n, seed);
    const Solution s = solve_in_process(p.view(), options).value();
    const auto best = testing::brute_force(p.view());
    ASSERT_TRUE(best);
    const double size = std::max(1.0, std::abs(best->objective));
    EXPECT_NEAR(best->objective, testing::box_qp_descent(n, seed), 1e-6 * size) << seed;
    EXPECT_TRUE(s.proved) << seed << " " << s.detail;
    EXPECT_NEAR(s.objective, best->objective, 2e-6 * size) << seed << " " << s.detail;
    EXPECT_LE(s.bound, best->objective + 1e-7 * size) << seed;
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << seed;
    for (int limit = 1; limit <= std::min<std::int64_t>(s.nodes, 12); ++limit) {
      options.node_limit = limit;
      const Solution early = solve_in_process(p.view(), options).value();
      EXPECT_LE(early.bound, best->objective + 1e-7 * size) << seed << " " << limit;
    }
    options.node_limit = Options().node_limit;
  }
}

// Each solve finds its own bounds: what was implied for the last numbers is not for these.
TEST(ImpliedBounds, FollowTheNumbersOfASession) {
  Options options;
  options.global_search = true;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    OwnedProblem p = testing::box_qp(4, seed);
    WarmSolver session = WarmSolver::create(Problem::create(p.view()).value(), options).value();
    std::mt19937_64 engine(seed);
    for (int tick = 0; tick < 6; ++tick) {
      const Solution s = session.solve({.g = p.g, .b = p.b, .l = p.l, .r = p.r, .A = p.A.values}).value();
      const auto best = testing::brute_force(p.view());
      ASSERT_TRUE(best);
      EXPECT_TRUE(s.proved) << seed << " " << tick << " " << s.detail;
      EXPECT_NEAR(s.objective, best->objective, 2e-6 * std::max(1.0, std::abs(best->objective))) << s.detail;
      for (double& value : p.b) value += static_cast<double>(engine() % 41) - 20.0;
      if (tick % 2 == 1) {
        for (double& value : p.A.values) value *= 1.0 + 0.02 * static_cast<double>(engine() % 5);
      }
      if (tick == 3) std::fill(p.l.begin() + 4, p.l.end(), 2.0);
    }
  }
}

}  // namespace
}  // namespace marble
