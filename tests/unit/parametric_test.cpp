#include "branch/parametric.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "branch/branch_engines.h"
#include "marble/examples.h"
#include "model/tuning.h"
#include "support/branch.h"
#include "support/random_problem.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kBudget = 200;

// An elastic branch of a problem, solved, and what a local search asks of it.
struct Setting {
  Setting(const OwnedProblem& p, double elastic_rho)
      : rho(elastic_rho),
        problem(scale(Problem::create(p.view()).value(), 10)),
        kkt(make_kkt(problem)),
        branch(problem, *kkt),
        parametric(problem, *kkt) {
    branch.point.start_from_point(Vector::Zero(problem.variables()));
    solved = branch.elastic.solve(run, rho, ElasticRelaxation::Rows::violated, kBudget);
    if (solved) parametric.start(branch.elastic);
  }

  // The elastic optimum with some pairs on their other side, by brute force.
  double objective_after(std::span<const Index> switched) {
    const auto own_kkt = make_kkt(problem);
    BranchEngines fresh(problem, *own_kkt);
    fresh.point.start_from_point(Vector::Zero(problem.variables()));
    WorkingSet set = branch.point.set;
    for (const Index pair : switched) set.switch_pair(pair);
    fresh.point.set = set;
    EXPECT_TRUE(fresh.elastic.solve(run, rho, ElasticRelaxation::Rows::violated, kBudget));
    return fresh.elastic.objective();
  }

  Options options;
  SolveControls controls;
  Run run{options, controls};
  double rho;
  ScaledProblem problem;
  std::unique_ptr<Kkt> kkt;
  BranchEngines branch;
  Parametric parametric;
  bool solved = false;
};

void expect_switches_predicted(const OwnedProblem& p, double rho) {
  Setting s(p, rho);
  ASSERT_TRUE(s.solved) << p.name;
  int predicted = 0;
  for (Index pair = 0; pair < s.problem.pairs(); ++pair) {
    const Parametric::Move moves[] = {{s.parametric.fixed_row(pair), false},
                                      {s.parametric.free_row(pair), true}};
    const auto objective = s.parametric.follow(moves, kInfinity, 0.0);
    if (!objective) continue;  // too many rows change
    ++predicted;
    const double expected = s.objective_after({&pair, 1});
    EXPECT_NEAR(*objective, expected, 1e-6 * (1.0 + std::abs(expected))) << p.name << " pair " << pair;
  }
  EXPECT_GE(predicted, s.problem.pairs() * 9 / 10) << p.name;
}

TEST(Parametric, PredictsTheOptimumAfterAFlipOfAnyPair) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 20, .equalities = 4, .inequalities = 12, .pairs = 8}, seed);
    for (const double rho : {10.0, 1e3, 1e6}) expect_switches_predicted(p, rho);
  }
}

TEST(Parametric, PredictsFlipsOfAStructuredProblem) {
  expect_switches_predicted(examples::hopper({.steps = 6}), 10.0);
  expect_switches_predicted(examples::hopper({.steps = 6}), 1e4);
}

TEST(Parametric, PredictsFlipsOfADenseProblem) {
  expect_switches_predicted(
      examples::qpec({.upper_variables = 4, .lower_variables = 12, .degenerate_pairs = 2}, 1), 1e4);
}

TEST(Parametric, PredictsTheOptimumAfterAnExchangeInAnyOrder) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 20, .equalities = 4, .inequalities = 12, .pairs = 6}, seed);
    Setting s(p, 1e3);
    ASSERT_TRUE(s.solved);
    const Index pairs[] = {static_cast<Index>(seed % 6), static_cast<Index>((seed + 2) % 6)};
    const double expected = s.objective_after(pairs);
    const Index e0 = s.parametric.fixed_row(pairs[0]);
    const Index q0 = s.parametric.free_row(pairs[0]);
    const Index e1 = s.parametric.fixed_row(pairs[1]);
    const Index q1 = s.parametric.free_row(pairs[1]);
    const Parametric::Move orders[][4] = {{{e0, false}, {q0, true}, {e1, false}, {q1, true}},
                                          {{e1, false}, {q0, true}, {q1, true}, {e0, false}},
                                          {{e0, false}, {e1, false}, {q1, true}, {q0, true}}};
    for (const auto& moves : orders) {
      const auto objective = s.parametric.follow(moves, kInfinity, kInfinity);
      ASSERT_TRUE(objective.has_value());
      EXPECT_NEAR(*objective, expected, 1e-6 * (1.0 + std::abs(expected))) << p.name;
    }
  }
}

TEST(Parametric, GivesUpExactlyOnWhatCannotEndBelowTheCutoff) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const OwnedProblem p = testing::random_problem({.variables = 20, .inequalities = 12, .pairs = 8}, seed);
    Setting s(p, 1e3);
    ASSERT_TRUE(s.solved);
    for (Index pair = 0; pair < s.problem.pairs(); ++pair) {
      const Parametric::Move moves[] = {{s.parametric.fixed_row(pair), false},
                                        {s.parametric.free_row(pair), true}};
      const auto unlimited = s.parametric.follow(moves, kInfinity, 0.0);
      if (!unlimited) continue;
      const double margin = 1e-9 * (1.0 + std::abs(*unlimited));
      EXPECT_FALSE(s.parametric.follow(moves, *unlimited - margin, 0.0).has_value());
      EXPECT_TRUE(s.parametric.follow(moves, *unlimited + margin, 0.0).has_value());
    }
  }
}

TEST(Parametric, TheWorkingSetItEndsWithIsTheOneOfTheNewOptimum) {
  const OwnedProblem p = testing::random_problem({.variables = 20, .inequalities = 12, .pairs = 8}, 3);
  Setting s(p, 1e3);
  ASSERT_TRUE(s.solved);
  for (Index pair = 0; pair < s.problem.pairs(); ++pair) {
    const Parametric::Move moves[] = {{s.parametric.fixed_row(pair), false},
                                      {s.parametric.free_row(pair), true}};
    ASSERT_TRUE(s.parametric.follow(moves, kInfinity, 0.0).has_value());
    WorkingSet before = s.branch.point.set;
    WorkingSet after = before;
    after.switch_pair(pair);
    s.parametric.read_active_rows(after);
    const int factorizations = s.run.factorizations;
    s.branch.point.set = after;
    ASSERT_TRUE(s.branch.elastic.solve(s.run, s.rho, ElasticRelaxation::Rows::held, kBudget));
    EXPECT_EQ(s.run.factorizations - factorizations, 1) << "the first guess was right";
    EXPECT_EQ(s.branch.point.set, after);
    s.branch.point.set = before;
    ASSERT_TRUE(s.branch.elastic.solve(s.run, s.rho, ElasticRelaxation::Rows::held, kBudget));
    s.parametric.start(s.branch.elastic);
  }
}

TEST(Parametric, FollowingMovesLeavesTheStartAsItWas) {
  const OwnedProblem p = testing::random_problem({.variables = 20, .inequalities = 12, .pairs = 8}, 5);
  Setting s(p, 1e3);
  ASSERT_TRUE(s.solved);
  const auto follow = [&](Index pair) {
    const Parametric::Move moves[] = {{s.parametric.fixed_row(pair), false},
                                      {s.parametric.free_row(pair), true}};
    return s.parametric.follow(moves, kInfinity, 0.0);
  };
  const auto first = follow(0);
  for (Index pair = 1; pair < 8; ++pair) static_cast<void>(follow(pair));
  EXPECT_EQ(follow(0), first) << "candidates are judged in any order";
  const int factorizations = s.run.factorizations;
  static_cast<void>(follow(3));
  EXPECT_EQ(s.run.factorizations, factorizations) << "and without a factorization";
}

TEST(Parametric, ReleasingWhatPullsLowersTheObjectiveAndWhatDoesNotIsFree) {
  int pulled = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Setting s(testing::random_problem({.variables = 20, .inequalities = 12, .pairs = 8}, seed), 1e3);
    ASSERT_TRUE(s.solved);
    for (Index pair = 0; pair < s.problem.pairs(); ++pair) {
      const Index row = s.parametric.fixed_row(pair);
      const Parametric::Move release[] = {{row, false}};
      const auto objective = s.parametric.follow(release, kInfinity, 0.0);
      if (!objective) continue;
      const double change = *objective - s.branch.elastic.objective();
      if (s.parametric.multiplier(row) < -1e-3) {
        ++pulled;
        EXPECT_LT(change, 0.0) << seed << " pair " << pair;
      } else if (s.parametric.multiplier(row) >= 0.0) {
        EXPECT_EQ(change, 0.0) << seed << " pair " << pair;
      }
    }
  }
  EXPECT_GT(pulled, 20);
}

TEST(Parametric, AProbeIsOfARowThatHasWayToGo) {
  int active = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Setting s(testing::random_problem({.variables = 20, .inequalities = 12, .pairs = 8}, seed), 1e3);
    ASSERT_TRUE(s.solved);
    for (Index pair = 0; pair < s.problem.pairs(); ++pair) {
      const bool biactive = s.branch.point.set.held[s.branch.point.set.free_row(pair)] != 0;
      active += biactive ? 1 : 0;
      EXPECT_EQ(s.parametric.probe(s.parametric.fixed_row(pair), s.parametric.free_row(pair)), !biactive)
          << seed;
      EXPECT_TRUE(biactive || s.parametric.probed_stiffness() > 0.0) << seed;
    }
  }
  EXPECT_GT(active, 0);
}

// Against all branches, each solved by itself.
TEST(Parametric, SaysThatNoBranchGainsOnlyWhereNoneDoes) {
  int excluded = 0, gained = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const OwnedProblem p = testing::random_problem({.pairs = 3}, seed);
    Setting s(p, tuning::exact_rho);
    std::vector<std::optional<double>> optima;
    for (unsigned branch = 0; branch < 8; ++branch) {
      const std::vector<bool> s_zero = {(branch & 1U) != 0, (branch & 2U) != 0, (branch & 4U) != 0};
      const Solution solution = solve_in_process(testing::branch(p, s_zero).view()).value();
      optima.push_back(solution.status == Status::solved ? std::optional(solution.objective) : std::nullopt);
    }
    double best = kInfinity;
    for (const std::optional<double>& optimum : optima) best = std::min(best, optimum.value_or(kInfinity));
    for (unsigned branch = 0; branch < 8; ++branch) {
      if (!optima[branch]) continue;
      for (Index pair = 0; pair < 3; ++pair)
        s.branch.point.set.fix(pair, (branch >> static_cast<unsigned>(pair) & 1U) != 0, false);
      if (!s.branch.exact.solve(s.run, kBudget)) continue;
      const double objective = s.problem.user_objective(s.branch.point.images.objective);
      ASSERT_NEAR(objective, *optima[branch], 1e-7 * (1.0 + std::abs(objective))) << seed;
      const bool gains = best < objective - 1e-6 * (1.0 + std::abs(objective));
      if (!s.parametric.may_gain(s.branch.point, tuning::exactness)) {
        ++excluded;
        EXPECT_FALSE(gains) << seed << " branch " << branch << ": " << best << " is below " << objective;
      }
      gained += gains ? 1 : 0;
    }
  }
  EXPECT_GT(excluded, 20);
  EXPECT_GT(gained, 20);
}

}  // namespace
}  // namespace marble
