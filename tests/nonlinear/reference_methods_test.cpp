// What the other methods promise: the lectures' formulas, the main loop's optima, and no answer that is none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formula.h"
#include "marble/nonlinear.h"

namespace marble::testing {
namespace {

using nonlinear::Method;
using nonlinear::Settings;
using Answered = Expected<nonlinear::Answer>;

constexpr Method kReferences[] = {Method::penalty, Method::alag, Method::barrier};

Answered solved_by(Method method, const nonlinear::Problem& problem, Settings settings = {}) {
  settings.method = method;
  return nonlinear::solve(problem, nonlinear::open_ticks_in_process, settings);
}

Formula of_known_problems(const std::string& name) {
  for (const auto& all : {classical_problems(), equilibrium_problems()})
    for (const Formula& one : all)
      if (one.name == name) return one;
  return {};
}

// The lectures' two examples of a penalty.
const Formula kAtLeastTwo{.name = "x ≥ 2", .optimum = 2, .start = {0}, .parts = [](const Jets& x) -> Parts {
                            return {.objective = x[0], .inequalities = {x[0] - 2}};
                          }};
const Formula kSumIsOne{
    .name = "sum is 1", .optimum = 0.5, .start = {3, -1}, .parts = [](const Jets& x) -> Parts {
      return {.objective = square(x[0]) + square(x[1]), .equalities = {x[0] + x[1] - 1}};
    }};

TEST(ReferenceMethods, PenaltiesMinimaLieWhereTheLecturesFormulasPutThem) {
  for (const double tolerance : {0.6, 0.06, 6e-4, 1e-6}) {  // the first μ with a violation below it
    const auto bound =
        solved_by(Method::penalty, problem_of(kAtLeastTwo), {.feasibility_tolerance = tolerance});
    ASSERT_TRUE(bound.has_value()) << bound.error().message();
    double mu = 1.0;
    while (1.0 / (2.0 * mu) > tolerance) mu *= 10.0;
    EXPECT_EQ(bound->status, Status::solved);
    EXPECT_NEAR(bound->x[0], 2.0 - 1.0 / (2.0 * mu), 1e-9);
    EXPECT_NEAR(bound->violation, 1.0 / (2.0 * mu), 1e-9);
    EXPECT_NEAR(bound->multipliers.inequalities[0], 1.0, 1e-3);

    const auto sum = solved_by(Method::penalty, problem_of(kSumIsOne), {.feasibility_tolerance = tolerance});
    ASSERT_TRUE(sum.has_value()) << sum.error().message();
    for (mu = 1.0; 1.0 / (1.0 + 2.0 * mu) > tolerance;) mu *= 10.0;
    EXPECT_EQ(sum->status, Status::solved);
    for (const double x : sum->x) EXPECT_NEAR(x, mu / (1.0 + 2.0 * mu), 1e-9);
    EXPECT_NEAR(sum->multipliers.equalities[0], -2.0 * mu / (1.0 + 2.0 * mu), 1e-3);  // 2μh
  }
}

TEST(ReferenceMethods, TheBarriersMinimumIsInsideByTheWeightOverTheMultiplier) {
  const Formula inside{.name = "inside", .optimum = 2, .start = {3}, .parts = kAtLeastTwo.parts};
  const auto answer = solved_by(Method::barrier, problem_of(inside));
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved);
  const double mu = std::pow(10.0, std::round(std::log10(answer->x[0] - 2.0)));  // x = 2 + μ
  EXPECT_LE(mu * std::abs(std::log(mu)), 1e-6);
  EXPECT_NEAR(answer->x[0] - 2.0, mu, 1e-3 * mu);
  EXPECT_EQ(answer->violation, 0.0);
}

TEST(ReferenceMethods, MultipliersReachWhatAPenaltyReachesAtATenThousandthOfItsWeight) {
  const auto largest_weight = [](Method method) {
    const auto answer = solved_by(method, problem_of(kSumIsOne));
    EXPECT_EQ(answer->status, Status::solved);
    EXPECT_NEAR(answer->x[0], 0.5, 1e-6);
    return std::stod(answer->detail.substr(answer->detail.find("weight ") + 7));
  };
  EXPECT_LE(1e4 * largest_weight(Method::alag), largest_weight(Method::penalty));
}

TEST(ReferenceMethods, EachEndsTheLecturesExampleAtItsSolution) {
  for (const Method method : kReferences) {
    for (const char* const name : {"murty", "murty_far", "murty_near"}) {
      for (const bool with_hessian : {true, false}) {
        const Formula formula = of_known_problems(name);
        const auto answer = solved_by(method, problem_of(formula, with_hessian));
        ASSERT_TRUE(answer.has_value()) << answer.error().message();
        EXPECT_EQ(answer->status, Status::solved) << answer->detail;
        EXPECT_NEAR(answer->x[0], 1.0, 1e-5);
        EXPECT_NEAR(answer->x[1], 3.0, 1e-5);
        EXPECT_NEAR(answer->multipliers.equalities[0], 1.0, 1e-3);
        EXPECT_NEAR(answer->multipliers.inequalities[0], 1.0, 1e-3);
        EXPECT_EQ(answer->multipliers.inequalities[1], 0.0);  // of a row that is far from its bound
        EXPECT_FALSE(answer->b_stationary.has_value());
        EXPECT_GT(answer->factorizations, 0);
        EXPECT_GE(answer->ticks, answer->iterations);
      }
    }
  }
}

TEST(ReferenceMethods, LinearProgramsFindAVertex) {
  for (const char* const name : {"murty", "murty_far", "murty_near", "murty_below"}) {
    const auto answer = solved_by(Method::slp, problem_of(of_known_problems(name)));
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->status, Status::solved) << answer->detail;
    EXPECT_NEAR(answer->x[0], 1.0, 1e-8);
    EXPECT_NEAR(answer->x[1], 3.0, 1e-8);
    EXPECT_EQ(answer->b_stationary, true);
  }
}

// How many end at the known optimum; whatever is called solved must bear the formula's own check.
std::size_t reached(const std::vector<Formula>& formulas, Method method, bool with_hessian) {
  std::size_t count = 0;
  for (const Formula& formula : formulas) {
    const auto answer = solved_by(method, problem_of(formula, with_hessian));
    if (!answer) {  // not inside
      EXPECT_EQ(method, Method::barrier) << formula.name << ": " << answer.error().message();
      EXPECT_NE(answer.error().message().find("the barrier begins inside"), std::string::npos);
      continue;
    }
    if (answer->status != Status::solved) continue;
    EXPECT_EQ(objection(formula, *answer), "") << formula.name;
    EXPECT_LE(answer->kkt_residual, 1e-2 * std::max(1.0, std::abs(formula.optimum))) << formula.name;
    count += std::abs(answer->objective - formula.optimum) <= 1e-4 * std::max(1.0, std::abs(formula.optimum));
  }
  return count;
}

TEST(ReferenceMethods, ClassicalProblemsAreReachedAsThePageSays) {
  const auto formulas = classical_problems();
  ASSERT_EQ(formulas.size(), 17u);
  EXPECT_GE(reached(formulas, Method::slp, true), 5u);
  EXPECT_EQ(reached(formulas, Method::penalty, true), 17u);
  EXPECT_EQ(reached(formulas, Method::alag, true), 17u);
  EXPECT_GE(reached(formulas, Method::barrier, true), 15u);
  EXPECT_GE(reached(formulas, Method::penalty, false), 16u);
  EXPECT_GE(reached(formulas, Method::alag, false), 16u);
  EXPECT_GE(reached(formulas, Method::barrier, false), 14u);
}

TEST(ReferenceMethods, PairsAreReachedByTheirProducts) {
  const auto formulas = equilibrium_problems();
  EXPECT_GE(reached(formulas, Method::penalty, true), 40u);
  EXPECT_GE(reached(formulas, Method::alag, true), 42u);
  EXPECT_GE(reached(formulas, Method::barrier, true), 12u);
}

TEST(ReferenceMethods,
     ACornerWithNoMultipliersIsNotCalledSolved) {  // ralph1: not even the limit is stationary
  for (const Method method : kReferences) {
    const auto answer = solved_by(method, problem_of(of_known_problems("ralph1")));
    EXPECT_FALSE(answer && is_solved(answer->status)) << answer->detail;
  }
}

TEST(ReferenceMethods, AnInfeasibleProblemIsNotCalledSolved) {
  const Formula never{.name = "never", .optimum = 0, .start = {1}, .parts = [](const Jets& x) -> Parts {
                        return {.objective = x[0], .equalities = {square(x[0]) + 1}};
                      }};
  for (const Method method : kReferences) {
    const auto answer = solved_by(method, problem_of(never));
    ASSERT_TRUE(answer.has_value());
    EXPECT_FALSE(is_solved(answer->status)) << answer->detail;
    EXPECT_NEAR(answer->violation, 1.0, 1e-3);
  }
}

TEST(ReferenceMethods, BoundsAreNeverLeftAndHaveTheirMultipliers) {
  Formula bounded = kSumIsOne;  // x0 ≤ 0.2
  bounded.upper = {0.2, kFree};
  for (const Method method : kReferences) {
    const auto answer = solved_by(method, problem_of(bounded));
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->status, Status::solved) << answer->detail;
    EXPECT_NEAR(answer->x[0], 0.2, 1e-12);
    EXPECT_NEAR(answer->x[1], 0.8, 1e-5);
    EXPECT_NEAR(answer->multipliers.bounds[0], 0.4 - 1.6, 1e-4);
  }
}

TEST(ReferenceMethods, TheTableIsOfTheProblemAndTheLimitOfAllRounds) {
  for (const Method method : kReferences) {
    const Formula formula = of_known_problems("murty");
    std::int32_t rows = 0, ticks = 0;
    Settings settings;
    settings.iteration_limit = 12;
    settings.iteration = [&](const nonlinear::Iteration& row) {
      EXPECT_EQ(row.iteration, rows++);
      EXPECT_GT(row.ticks, ticks);
      ticks = row.ticks;
      EXPECT_DOUBLE_EQ(row.objective, std::pow(row.x[0], 3) + row.x[1] * row.x[1]);
      EXPECT_GE(row.violation, std::abs(10 - row.x[0] * row.x[0] - row.x[1] * row.x[1]) * (1 - 1e-12));
    };
    const auto answer = solved_by(method, problem_of(formula), settings);
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->status, Status::iteration_limit);
    EXPECT_EQ(answer->iterations, 12);
    EXPECT_GE(rows, 9);  // the last of a round has no row
  }
}

TEST(ReferenceMethods, FaultsAreNamedAsTheCallersFunctionsAre) {
  const auto refused = [](Method method, const nonlinear::Problem& problem, const Settings& settings = {}) {
    const auto answer = solved_by(method, problem, settings);
    return answer ? answer->detail : answer.error().message();
  };
  const auto names = [](const std::string& message, const char* field) {
    EXPECT_NE(message.find(field), std::string::npos) << message;
  };
  for (const Method method : kReferences) {
    Formula infinite = of_known_problems("murty");
    infinite.parts = [](const Jets& x) -> Parts {
      return {.objective = x[0], .inequalities = {x[0], log(x[1] - 3)}};
    };
    names(refused(method, problem_of(infinite)), "values.inequalities[1]");

    nonlinear::Problem changing = problem_of(of_known_problems("murty"));
    const auto first = changing.values;
    changing.values = [first, calls = 0](std::span<const double> x) mutable {
      auto values = first(x);
      if (++calls == 3) values.equalities = {};
      return values;
    };
    names(refused(method, changing), "values.equalities");

    names(refused(method, problem_of(kSumIsOne), {.curvature = nonlinear::Curvature::none}),
          "settings.curvature");
    names(refused(method, problem_of(kSumIsOne, false), {.curvature = nonlinear::Curvature::exact}),
          "hessian");
  }
  names(refused(Method::barrier, problem_of(of_known_problems("murty_below"))), "values.inequalities[0]");
  names(refused(Method::slp, problem_of(kSumIsOne), {.curvature = nonlinear::Curvature::exact}),
        "settings.curvature");
  EXPECT_EQ(*nonlinear::method_of("alag"), Method::alag);
  names(nonlinear::method_of("newton").error().message(), "nonlinear_method");
}

}  // namespace
}  // namespace marble::testing
