#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "marble/examples.h"
#include "marble/macmpec.h"
#include "marble/solver.h"
#include "support/brute_force.h"
#include "support/independent_check.h"
#include "support/integer_problem.h"
#include "support/other_units.h"
#include "support/random_problem.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

// The reference that others are compared with: it must be right where the answer is known.
double slack(double objective) { return 1e-6 * std::max(1.0, std::abs(objective)); }

TEST(BruteForce, ProvesTheOptimumOfEverySmallProblem) {
  for (const auto& [problem, optimum] : small_problems()) {
    const auto best = brute_force(problem.view());
    ASSERT_TRUE(best.has_value()) << problem.name;
    EXPECT_NEAR(best->objective, optimum, slack(optimum)) << problem.name;
    EXPECT_LE(judge_point(problem.view(), best->z).infeasibility(), 1e-6) << problem.name;
  }
}

TEST(BruteForce, ProvesTheOptimumOfEveryKnownProblem) {
  int proved = 0;
  for (const auto& [problem, optimum] : known_problems()) {
    if (problem.l.size() > 10) continue;
    ++proved;
    const auto best = brute_force(problem.view());
    ASSERT_TRUE(best.has_value()) << problem.name;
    EXPECT_NEAR(best->objective, optimum, slack(optimum)) << problem.name;
    EXPECT_LE(judge_point(problem.view(), best->z).infeasibility(), 1e-6) << problem.name;
  }
  EXPECT_EQ(proved, 29) << "of one with 12 pairs the collection's own word is taken";
}

TEST(BruteForce, ProvesTheOptimaOfMacmpec) {
  int proved = 0;
  for (const examples::MacmpecProblem& each : examples::macmpec()) {
    const OwnedProblem problem = each.problem();
    if (problem.l.size() > 10) continue;
    ++proved;
    const auto best = brute_force(problem.view());
    ASSERT_TRUE(best.has_value()) << each.name;
    EXPECT_NEAR(best->objective, each.optimum, slack(each.optimum)) << each.name;
  }
  EXPECT_EQ(proved, 24);
}

TEST(BruteForce, NoFeasibleRandomPointIsBetter) {
  // The point that a random problem is built around is feasible; so are those the solver returns.
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p =
        random_problem({.variables = 8, .equalities = 2, .inequalities = 4, .pairs = 4}, seed);
    const auto best = brute_force(p.view());
    ASSERT_TRUE(best.has_value()) << p.name;
    EXPECT_GE(best->feasible_branches, 1);
    EXPECT_LE(judge_point(p.view(), best->z).infeasibility(), 1e-6) << p.name;
    EXPECT_NEAR(judge_point(p.view(), best->z).objective, best->objective, slack(best->objective)) << p.name;
    const Solution s = solve_in_process(p.view()).value();
    if (!is_solved(s.status)) continue;
    ++compared;
    EXPECT_GE(s.objective, best->objective - slack(best->objective)) << p.name;
  }
  EXPECT_GE(compared, 15);
}

OwnedProblem two_variables(double gradient_x, double gradient_y) {
  OwnedProblem p;
  p.g = {gradient_x, gradient_y};
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = {0.0};
  p.r = {0.0};
  return p;
}

TEST(BruteForce, SaysWhenNoPieceIsFeasible) {
  OwnedProblem p = two_variables(1.0, 1.0);
  p.C = compress(2, 2, {{0, 1}, {0, 1}, {1.0, 1.0}}, "C").value();
  p.d = {-1.0, -1.0};  // x ≥ 1 and y ≥ 1, but x y = 0
  EXPECT_FALSE(brute_force(p.view()).has_value());
  p.d = {-1.0, 0.0};
  const auto best = brute_force(p.view());
  ASSERT_TRUE(best.has_value());
  EXPECT_EQ(best->feasible_branches, 1);
  EXPECT_NEAR(best->objective, 1.0, 1e-6);
}

TEST(BruteForce, SaysWhenAPieceIsUnbounded) {
  const auto best = brute_force(two_variables(1.0, -1.0).view());
  ASSERT_TRUE(best.has_value());
  EXPECT_EQ(best->objective, -std::numeric_limits<double>::infinity());
}

TEST(BruteForce, ReadsEitherFormOfQ) {
  OwnedProblem p = two_variables(-1.0, -2.0);
  p.Q = compress(2, 2, {{0, 0, 1, 1}, {0, 1, 0, 1}, {2.0, 1.0, 1.0, 2.0}}, "Q").value();
  const double full = brute_force(p.view())->objective;
  p.Q = compress(2, 2, {{0, 0, 1}, {0, 1, 1}, {2.0, 1.0, 2.0}}, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  EXPECT_NEAR(full, -1.0, 1e-6);
  EXPECT_NEAR(brute_force(p.view())->objective, full, 1e-9);
}

TEST(BruteForce, RefusesWhatItCannotProve) {
  OwnedProblem p = two_variables(0.0, 0.0);
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {-1.0, 1.0}}, "Q").value();
  EXPECT_THROW(static_cast<void>(brute_force(p.view())), std::invalid_argument);
  const OwnedProblem many = random_problem({.variables = 12, .pairs = 13}, 1);
  EXPECT_THROW(static_cast<void>(brute_force(many.view())), std::invalid_argument);
}

// A judge that cannot condemn would make every other test pass: each fault must show, and only where it is.

// min zᵀz, z₁ = 1, z₂ ≥ 1, 0 ≤ z₃ + 1 ⊥ z₄ − 1 ≥ 0 at its optimum (1, 1, 0, 1).
class Judge : public ::testing::Test {
 protected:
  Judge() {
    s.z = {1, 1, 0, 1};
    s.equality_multipliers = {-2};
    s.inequality_multipliers = {2};
    s.complementarity_multipliers_L = {0};
    s.complementarity_multipliers_R = {2};
  }
  [[nodiscard]] Verdict verdict() const { return judge(p.view(), s); }

  OwnedProblem p = public_example().problem;
  Solution s;
};

TEST_F(Judge, AcceptsTheOptimum) {
  const Verdict v = verdict();
  EXPECT_EQ(v.infeasibility(), 0.0);
  EXPECT_EQ(v.stationarity, 0.0);
  EXPECT_EQ(v.wrong_sign, 0.0);
  EXPECT_EQ(v.slackness, 0.0);
  EXPECT_EQ(v.objective, 3.0);
}

TEST_F(Judge, MeasuresEachViolation) {
  s.z = {1.25, 0.5, 0.5, 1.75};
  const Verdict v = verdict();
  EXPECT_DOUBLE_EQ(v.equality, 0.25);
  EXPECT_DOUBLE_EQ(v.inequality, 0.5);
  EXPECT_DOUBLE_EQ(v.complementarity, 0.75);  // s = 1.5, t = 0.75
  EXPECT_DOUBLE_EQ(v.infeasibility(), 0.75);
}

TEST_F(Judge, ANegativeSideOfAPairIsAViolation) {
  s.z[3] = 0.5;
  EXPECT_DOUBLE_EQ(verdict().complementarity, 0.5);
  s.z = {1, 1, -4, 1};
  EXPECT_DOUBLE_EQ(verdict().complementarity, 3.0);
}

TEST_F(Judge, MeasuresStationarityAgainstTheLargestTerm) {
  s.equality_multipliers = {-1};
  EXPECT_DOUBLE_EQ(verdict().stationarity, 1.0 / 3.0);  // 2 − 1, its largest term is 2
}

TEST_F(Judge, SeesAMultiplierOfTheWrongSign) {
  s.inequality_multipliers = {-2};
  EXPECT_DOUBLE_EQ(verdict().wrong_sign, 2.0);
  EXPECT_GT(verdict().stationarity, 0.1);
}

TEST_F(Judge, SeesAMultiplierOfAnInactiveRow) {
  s.z = {1, 2, 0, 1};
  EXPECT_DOUBLE_EQ(verdict().slackness, 2.0 / 3.0);
  s.z = {1, 1, 0, 1};
  s.complementarity_multipliers_L = {1};
  EXPECT_DOUBLE_EQ(verdict().slackness, 1.0 / 3.0);
  s.complementarity_multipliers_L = {0};
  s.z[3] = 4.0;
  EXPECT_DOUBLE_EQ(verdict().slackness, 2.0);
}

TEST_F(Judge, NanIsTheWorstOfAll) {
  s.z[1] = std::nan("");
  EXPECT_EQ(verdict().inequality, std::numeric_limits<double>::infinity());
  EXPECT_EQ(verdict().stationarity, std::numeric_limits<double>::infinity());
  EXPECT_EQ(verdict().infeasibility(), std::numeric_limits<double>::infinity());
}

TEST_F(Judge, ReadsEitherFormOfQ) {
  p.Q = compress(4, 4, {{0, 0, 1, 1, 2, 3}, {0, 1, 0, 1, 2, 3}, {2, 1, 1, 2, 2, 2}}, "Q").value();
  const Verdict full = verdict();
  p.Q = compress(4, 4, {{0, 0, 1, 2, 3}, {0, 1, 1, 2, 3}, {2, 1, 2, 2, 2}}, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  EXPECT_EQ(full.objective, 4.0);
  EXPECT_EQ(verdict().objective, full.objective);
  EXPECT_EQ(verdict().stationarity, full.stationarity);
  EXPECT_GT(full.stationarity, 0.0);
}

}  // namespace
}  // namespace marble::testing

namespace marble {
namespace {

// What the enumeration of all branches says of random problems of small integers, the solver says too.
constexpr std::uint64_t kSeeds = 60;

class IntegerProblem : public ::testing::TestWithParam<testing::IntegerFamily> {
 protected:
  template <class Judge>
  void for_each_seed(const Options& options, Judge&& judge) const {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const OwnedProblem p = testing::integer_problem(GetParam(), seed);
      const auto truth = testing::brute_force(p.view());
      const Solution found = solve_in_process(p.view(), options).value();
      ASSERT_EQ(found.status, testing::true_status(truth)) << p.name << ": " << found.detail;
      judge(p, truth, found);
    }
  }
};

TEST_P(IntegerProblem, GlobalModeHasTheStatusTheOptimumAndATrueBound) {
  Options options;
  options.global_search = true;
  for_each_seed(options, [](const OwnedProblem& p, const auto& truth, const Solution& found) {
    if (found.status != Status::solved) return;
    const double slack = 1e-6 * std::max(1.0, std::abs(truth->objective));
    EXPECT_NEAR(found.objective, truth->objective, slack) << p.name;
    EXPECT_LE(found.bound, truth->objective + slack) << p.name;
    EXPECT_TRUE(found.proved) << p.name << ": " << found.detail;
    EXPECT_LE(testing::judge(p.view(), found).infeasibility(), 1e-9) << p.name;
  });
}

TEST_P(IntegerProblem, ALocalAnswerIsBStationary) {
  for_each_seed({}, [](const OwnedProblem& p, const auto& truth, const Solution& found) {
    if (found.status != Status::solved) return;
    EXPECT_TRUE(found.b_stationary.value_or(false)) << p.name;
    const double slack = 1e-6 * std::max(1.0, std::abs(truth->objective));
    EXPECT_GE(found.objective, truth->objective - slack) << p.name;
    EXPECT_LE(testing::judge(p.view(), found).infeasibility(), 1e-9) << p.name;
  });
}

INSTANTIATE_TEST_SUITE_P(Families, IntegerProblem, ::testing::ValuesIn(testing::kIntegerFamilies),
                         [](const auto& family) { return std::string(testing::name(family.param)); });

// Answers that are known, to be reached: thirty small problems and the three of robotics.
using testing::judge;

// Where a branch is a single point no switch leads to the next, and a path ends at one that is not the best.
// Better than this is welcome.
double reached(const testing::SmallProblem& p, Path path) {
  if (p.problem.name == "linear bilevel") return -7.0;
  if (p.problem.name == "knapsack") return -4.0;
  if (path == Path::paper && p.problem.name == "game") return 0.0;
  if (path == Path::paper && p.problem.name == "gap") return 1.44;
  return p.optimum;
}

TEST(KnownProblems, AreSolvedToTheOptimumThatIsKnownOnEitherPath) {
  const auto problems = testing::known_problems();
  ASSERT_EQ(problems.size(), 30U);
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    for (const testing::SmallProblem& known : problems) {
      const auto& [problem, optimum] = known;
      // Of its solutions, a continuum, `paper` ends at one that it does not polish.
      const bool exact = path == Path::fast || problem.name != "bilevel2m";
      const Solution s = solve_in_process(problem.view(), options).value();
      const double slack = (exact ? 1e-8 : 1e-6) * (1.0 + std::abs(optimum));
      EXPECT_EQ(s.status, Status::solved) << problem.name << ": " << s.detail;
      EXPECT_GE(s.objective, optimum - slack) << problem.name << ": " << s.detail;
      EXPECT_LE(s.objective, reached(known, path) + slack) << problem.name;
      const testing::Verdict verdict = judge(problem.view(), s);
      EXPECT_NEAR(verdict.objective, s.objective, slack) << problem.name;
      EXPECT_LE(verdict.infeasibility(), exact ? 1e-9 : 1e-6) << problem.name;
      EXPECT_LE(verdict.stationarity, exact ? 1e-9 : 1e-6) << problem.name;
      EXPECT_LE(verdict.wrong_sign, 1e-8) << problem.name;
    }
  }
}

// Nothing before it and nothing after it: it ends at what its own tolerances allow, and more often at none.
TEST(KnownProblems, AreMostlySolvedByTheAlgorithmAsItIsPrinted) {
  int solved = 0;
  for (const testing::SmallProblem& known : testing::known_problems()) {
    const OwnedProblem& problem = known.problem;
    const Solution s = solve_in_process(problem.view(), {.path = Path::algorithm1}).value();
    if (!is_solved(s.status)) continue;
    ++solved;
    EXPECT_EQ(s.detail.find("local search"), std::string::npos) << problem.name << ": " << s.detail;
    EXPECT_FALSE(s.proved) << problem.name;
    EXPECT_LE(judge(problem.view(), s).infeasibility(), 1e-6) << problem.name;
    EXPECT_GE(s.objective, known.optimum - 1e-3 * (1.0 + std::abs(known.optimum))) << problem.name;
  }
  EXPECT_GE(solved, 20);
}

// Of these each branch is a point or nearly one: which minimum is found hangs on the way there.
bool has_many_minima(const std::string& name) {
  return name == "linear bilevel" || name == "aiyoshi and shimizu" || name == "knapsack" ||
         name == "cardinality" || name == "game";
}

TEST(KnownProblems, HaveTheSameAnswersInOtherUnitsOfVariablesRowsAndCost) {
  std::vector<testing::OtherUnits> all;
  const auto power = [](int exponent) { return [=] { return std::pow(10.0, exponent); }; };
  for (int k = -8; k <= 8; k += 2) all.push_back({power(k)});
  for (const int k : {-6, 6}) {
    all.push_back({power(0), power(k)});
    all.push_back({power(0), power(0), std::pow(10.0, k)});
  }
  for (const testing::SmallProblem& known : testing::known_problems()) {
    const double slack = 1e-6 * (1.0 + std::abs(known.optimum));
    for (const testing::OtherUnits& units : all) {
      auto [problem, variables] = testing::convert(known.problem, units);
      Solution s = solve_in_process(problem.view()).value();
      EXPECT_EQ(s.status, Status::solved) << problem.name << ": " << s.detail;
      if (!has_many_minima(problem.name)) {
        EXPECT_NEAR(s.objective / units.cost, known.optimum, slack)
            << problem.name << ", z by " << variables[0] << ", cost by " << units.cost;
      }
      for (std::size_t j = 0; j < variables.size(); ++j) s.z[j] *= variables[j];
      // The tolerance of 10⁻⁶ is that of the other units, where rows may be 10⁻⁶ times as large.
      const double allowed = problem.name == "bilevel2m" ? 1e-5 : 1e-6;
      EXPECT_LE(judge(known.problem.view(), s).infeasibility(), allowed) << problem.name;
    }
  }
}

TEST(KnownProblems, OfRoboticsAreSolvedToTheObjectivesThatTheReadmeReports) {
  const struct {
    OwnedProblem problem;
    double objective;
    int factorizations;
  } robotics[] = {{examples::hopper(), 27.0, 600},
                  {examples::gates(), 455.8601, 400},
                  {examples::rocket(), 422.1117, 300}};
  for (const auto& [problem, objective, factorizations] : robotics) {
    const Solution s = solve_in_process(problem.view()).value();
    EXPECT_EQ(s.status, Status::solved) << problem.name << ": " << s.detail;
    EXPECT_LE(s.objective, objective) << problem.name;
    EXPECT_LE(s.factorizations, factorizations) << problem.name;
    const testing::Verdict verdict = judge(problem.view(), s);
    EXPECT_NEAR(verdict.objective, s.objective, 1e-8 * s.objective) << problem.name;
    EXPECT_LE(verdict.infeasibility(), 1e-8) << problem.name;
    EXPECT_LE(verdict.stationarity, 1e-8) << problem.name;
  }
}

}  // namespace
}  // namespace marble

namespace marble::testing {
namespace {

TEST(RandomProblem, HasTheSizesAskedForAndIsValid) {
  for (const Index n_e : {0, 2}) {
    for (const Index n_i : {0, 3}) {
      for (const Index n_c : {0, 4}) {
        for (const bool indefinite : {false, true}) {
          const OwnedProblem p = random_problem({.variables = 7,
                                                 .equalities = n_e,
                                                 .inequalities = n_i,
                                                 .pairs = n_c,
                                                 .indefinite = indefinite},
                                                11);
          const auto problem = Problem::create(p.view());
          ASSERT_TRUE(problem.has_value()) << problem.error().message();
          EXPECT_EQ(problem->variables(), 7);
          EXPECT_EQ(problem->equalities(), n_e);
          EXPECT_EQ(problem->inequalities(), n_i);
          EXPECT_EQ(problem->pairs(), n_c);
        }
      }
    }
  }
}

TEST(RandomProblem, ASeedMeansTheSameProblem) {
  EXPECT_EQ(random_problem({}, 5).Q.values, random_problem({}, 5).Q.values);
  EXPECT_EQ(random_problem({}, 5).l, random_problem({}, 5).l);
  EXPECT_NE(random_problem({}, 5).g, random_problem({}, 6).g);
}

TEST(RandomProblem, IsFeasible) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const OwnedProblem p = random_problem(
        {.variables = 6, .equalities = 2, .inequalities = 6, .pairs = 3, .density = 0.2}, seed);
    EXPECT_TRUE(brute_force(p.view()).has_value()) << p.name;
  }
}

}  // namespace
}  // namespace marble::testing
