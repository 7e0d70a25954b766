// Roots, powers and logarithms at the bounds of their arguments: derivatives that are infinite, or no
// numbers.
#include <gtest/gtest.h>

#include <cmath>

#include "formula.h"
#include "marble/nonlinear.h"

namespace marble::testing {
namespace {

using nonlinear::Curvature;
using nonlinear::Settings;

// Of one variable that is at least 0.
Formula above_zero(const char* name, double start, double optimum, std::function<Jet(const Jet&)> objective) {
  return {.name = name,
          .optimum = optimum,
          .start = {start},
          .parts = [objective = std::move(objective)](const Jets& x) -> Parts {
            return {.objective = objective(x[0])};
          },
          .lower = {0}};
}

Expected<nonlinear::Answer> end_of(const Formula& formula, const Settings& settings = {}) {
  return nonlinear::solve(problem_of(formula), nonlinear::open_ticks_in_process, settings);
}

void expect_optimum(const Formula& formula, const Settings& settings = {}) {
  const auto answer = end_of(formula, settings);
  ASSERT_TRUE(answer.has_value()) << formula.name << ": " << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved) << formula.name << ": " << answer->detail;
  EXPECT_NEAR(answer->objective, formula.optimum, 1e-6) << formula.name;
  EXPECT_EQ(objection(formula, *answer), "") << formula.name;
}

TEST(NonlinearSingular, ASecondDerivativeThatIsInfiniteIsReplaced) {
  const auto rising = [](const Jet& x) { return pow(x, 1.5) + x; };
  const auto falling = [](const Jet& x) { return pow(x, 1.5) - x; };
  for (const double start : {0.0, 1.0, 100.0}) {
    expect_optimum(above_zero("rising", start, 0, rising));
    expect_optimum(above_zero("falling", start, -4.0 / 27, falling));
  }
  const auto reported = end_of(above_zero("rising", 0, 0, rising));
  ASSERT_TRUE(reported.has_value());
  EXPECT_NE(reported->detail.find("entries of 1 Hessian were not finite"), std::string::npos)
      << reported->detail;
}

// A multiplier of 0 times an infinite second derivative.
TEST(NonlinearSingular, ASecondDerivativeThatIsNoNumberIsReplaced) {
  const Formula formula{.name = "no number",
                        .optimum = 0.5,
                        .start = {0, 0.2},
                        .parts = [](const Jets& x) -> Parts {
                          return {.objective = square(x[0] - 0.5) + square(x[1] - 0.5),
                                  .equalities = {pow(x[0], 1.5) + pow(x[1], 1.5) - 1},
                                  .G = {x[0]},
                                  .H = {x[1]}};
                        },
                        .lower = {0, 0}};
  expect_optimum(formula);
}

TEST(NonlinearSingular, ASlopeThatIsInfiniteKeepsTheStepOffTheBound) {
  const auto root = [](const Jet& x) { return x - pow(x, 0.5); };  // every long step from 4 ends at 0
  for (const Curvature curvature : {Curvature::automatic, Curvature::bfgs, Curvature::none})
    expect_optimum(above_zero("root", 4, -0.25, root), {.curvature = curvature, .radius = 100});
  // An optimum where the slope is infinite is none of a zero step: it is come near to, and that is said.
  const auto near = end_of(above_zero("to the bound", 1, 0, [](const Jet& x) { return pow(x, 0.5); }));
  ASSERT_TRUE(near.has_value()) << near.error().message();
  EXPECT_EQ(near->status, Status::numerical_failure);
  EXPECT_NE(near->detail.find("every step ends where derivatives.gradient[0] = inf"), std::string::npos)
      << near->detail;
  EXPECT_GT(near->x[0], 0.0);
  EXPECT_LE(near->x[0], 1e-8);
}

TEST(NonlinearSingular, AStartWithoutValueOrSlopeIsMovedOffItsBounds) {
  expect_optimum(above_zero("root", 0, -0.25, [](const Jet& x) { return x - pow(x, 0.5); }));
  expect_optimum(above_zero("logarithm", 0, 1, [](const Jet& x) { return x - log(x); }));
  expect_optimum({.name = "upper bound",
                  .optimum = -1.25,  // at 3/4
                  .start = {1},
                  .parts = [](const Jets& x) -> Parts { return {.objective = -x[0] - pow(1 - x[0], 0.5)}; },
                  .upper = {1}});
}

TEST(NonlinearSingular, WhatNoBoundExplainsIsNamedByFunctionAndRow) {
  const Formula slope{.name = "slope", .start = {1, 0}, .parts = [](const Jets& x) -> Parts {
                        return {.objective = x[0], .equalities = {x[0] + x[1] - 1, pow(x[1], 0.5)}};
                      }};
  const auto answer = end_of(slope);
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().field, "derivatives.equalities");
  EXPECT_EQ(answer.error().index, 1);
  const Formula value{.name = "value", .start = {-1}, .parts = [](const Jets& x) -> Parts {
                        return {.objective = x[0], .inequalities = {x[0] + 2, log(x[0])}};
                      }};
  const auto none = end_of(value);
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().field, "values.inequalities");
  EXPECT_EQ(none.error().index, 1);
}

}  // namespace
}  // namespace marble::testing
