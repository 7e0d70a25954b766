// Starts far away, and data near the ends of the doubles: an answer that is called solved is one, and every
// number of every answer is finite.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "marble/solver.h"
#include "marble/warm_solver.h"
#include "support/brute_force.h"
#include "support/dense_matrix.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

// min z₀² + z₁² − 2 z₀ − 4 z₁ with z₀ ⊥ z₁: −4 at (0, 2).
OwnedProblem first_example() {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::Matrix2d{{2.0, 0.0}, {0.0, 2.0}});
  p.g = {-2.0, -4.0};
  p.L = testing::sparse(Eigen::RowVector2d{1.0, 0.0});
  p.R = testing::sparse(Eigen::RowVector2d{0.0, 1.0});
  p.l = p.r = {0.0};
  return p;
}

std::vector<OwnedProblem> small_problems() {
  std::vector<OwnedProblem> problems = {first_example()};
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
    problems.push_back(
        testing::random_problem({.variables = 6, .equalities = 1, .inequalities = 2, .pairs = 3}, seed));
  return problems;
}

bool all_finite(const std::vector<double>& values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

// All but bound, gap and reference_objective, which may be infinite.
void expect_finite(const Solution& s, const std::string& where) {
  EXPECT_TRUE(all_finite(s.z)) << where;
  EXPECT_TRUE(all_finite(s.equality_multipliers)) << where;
  EXPECT_TRUE(all_finite(s.inequality_multipliers)) << where;
  EXPECT_TRUE(all_finite(s.complementarity_multipliers_L)) << where;
  EXPECT_TRUE(all_finite(s.complementarity_multipliers_R)) << where;
  EXPECT_TRUE(all_finite(s.certificate)) << where;
  EXPECT_TRUE(all_finite({s.objective, s.kkt_residual, s.violations.equality, s.violations.inequality,
                          s.violations.complementarity}))
      << where;
  EXPECT_FALSE(std::isnan(s.bound) || std::isnan(s.gap) || std::isnan(s.reference_objective)) << where;
}

// Whether it is solved; if so it must be a solution.
bool judged(const OwnedProblem& p, const Solution& answer, double optimum, const std::string& where) {
  expect_finite(answer, where + " " + answer.detail);
  if (!is_solved(answer.status)) return false;
  const testing::Verdict verdict = testing::judge(p.view(), answer);
  EXPECT_LE(verdict.infeasibility(), 1e-5) << where;
  EXPECT_LE(verdict.stationarity, 1e-4) << where;
  EXPECT_LE(verdict.slackness, 1e-4) << where;
  EXPECT_GE(answer.objective, optimum - 1e-4 * (1.0 + std::abs(optimum))) << where;
  return true;
}

std::vector<double> far(std::size_t size, int power, int signs) {
  std::vector<double> z(size, std::pow(10.0, power));
  for (std::size_t i = 0; i < size; ++i)
    if ((signs >> (i % 8)) & 1) z[i] = -z[i];
  return z;
}

TEST(FarStart, InitialPointNeverEndsSolvedElsewhere) {
  for (const OwnedProblem& p : small_problems()) {
    const double optimum = testing::brute_force(p.view()).value().objective;
    int solved = 0, starts = 0;
    for (int power = 0; power <= 308; ++power) {
      for (const int signs : {0, 1, 2, 0xff}) {
        const std::vector<double> z = far(p.g.size(), power, signs);
        const auto answer = solve_in_process(p.view(), {}, {.initial_z = z}).value();
        solved += judged(p, answer, optimum, p.name + " 1e" + std::to_string(power));
        ++starts;
      }
    }
    EXPECT_GE(solved, 95 * starts / 100) << p.name;
  }
}

TEST(FarStart, FirstExampleMeetsItsOptimumFromEveryStart) {
  const OwnedProblem p = first_example();
  for (int power = 0; power <= 308; ++power) {
    for (int signs = 0; signs < 4; ++signs) {
      const std::vector<double> z = far(2, power, signs);
      const auto answer = solve_in_process(p.view(), {}, {.initial_z = z}).value();
      EXPECT_EQ(answer.status, Status::solved) << power << " " << answer.detail;
      EXPECT_NEAR(answer.objective, -4.0, 1e-6) << power << " " << answer.detail;
    }
  }
}

TEST(FarStart, WarmStartNeverEndsSolvedElsewhere) {
  for (const OwnedProblem& p : small_problems()) {
    const double optimum = testing::brute_force(p.view()).value().objective;
    const Solution good = solve_in_process(p.view()).value();
    for (int power = 0; power <= 308; power += 4) {
      for (const int signs : {0, 1, 0xff}) {
        for (const bool multipliers : {false, true}) {
          Solution start = good;
          start.z = far(start.z.size(), power, signs);
          if (multipliers)
            for (auto* values : {&start.equality_multipliers, &start.inequality_multipliers,
                                 &start.complementarity_multipliers_L, &start.complementarity_multipliers_R})
              *values = far(values->size(), power, signs);
          const auto answer = solve_in_process(p.view(), {}, {.warm_start = &start}).value();
          static_cast<void>(judged(p, answer, optimum, p.name + " 1e" + std::to_string(power)));
        }
      }
    }
  }
}

TEST(FarStart, SessionGoesOnAfterOne) {
  const OwnedProblem p = first_example();
  const Problem problem = Problem::create(p.view()).value();
  WarmSolver solver = WarmSolver::create(problem).value();
  for (int power = 0; power <= 308; power += 7) {
    const std::vector<double> z = far(2, power, power);
    const auto answer = solver.solve({}, {.initial_z = z}).value();
    EXPECT_TRUE(judged(p, answer, -4.0, "1e" + std::to_string(power))) << answer.detail;
    const auto next = solver.solve({}, {.cold = power % 2 == 0}).value();
    EXPECT_NEAR(next.objective, -4.0, 1e-6) << power;
  }
}

TEST(FarStart, IsNamedWhereItIsDropped) {
  const OwnedProblem p = first_example();
  const std::vector<double> z = {1e308, 1e308};
  const auto answer = solve_in_process(p.view(), {}, {.initial_z = z}).value();
  EXPECT_NE(answer.detail.find("start was too far away"), std::string::npos) << answer.detail;
}

TEST(HostileNumbers, EveryNumberOfAnAnswerIsFinite) {
  constexpr double kNumbers[] = {1e308, -1e308, 1e-308, 5e-324, 1e200, -1e200, 1e150, 0.0, 1.0, -1.0};
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    OwnedProblem p =
        testing::random_problem({.variables = 5, .equalities = 1, .inequalities = 2, .pairs = 2}, seed);
    std::mt19937_64 random(seed);
    const auto spoil = [&](std::vector<double>& values) {
      if (!values.empty() && random() % 2 == 0)
        values[random() % values.size()] = kNumbers[random() % std::size(kNumbers)];
    };
    for (auto* vector : {&p.g, &p.b, &p.d, &p.l, &p.r}) spoil(*vector);
    for (auto* matrix : {&p.A, &p.C, &p.L, &p.R}) spoil(matrix->values);
    if (seed % 5 == 0) p.c0 = 1e308;
    std::vector<double> start(p.g.size(), 0.0);
    spoil(start);
    Options options;
    options.global_search = seed % 3 == 0;
    options.scaling_passes = seed % 7 == 0 ? 0 : 10;
    options.max_iterations = 200;
    options.node_limit = 50;
    const std::string where = "seed " + std::to_string(seed);
    const auto problem = Problem::create(p.view());
    if (!problem) continue;
    auto session = WarmSolver::create(*problem, options, start);
    ASSERT_TRUE(session) << where;
    const Solution first = session->solve().value();
    expect_finite(first, where + ": " + first.detail);
    spoil(p.g);
    const Solution next = session->solve({.g = p.g}, {.initial_z = start}).value();
    expect_finite(next, where + ": " + next.detail);
    Options none = options;
    none.time_limit_s = 0.0;
    const auto ended = solve_in_process(p.view(), none, {.initial_z = start}).value();
    expect_finite(ended, where + ": " + ended.detail);
  }
}

}  // namespace
}  // namespace marble
