#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formula.h"
#include "marble/nonlinear.h"
#include "pole_problems.h"

namespace marble::testing {
namespace {

// The loop from near a pole, and the statuses of steps that are zero although x is not stationary.
using nonlinear::Answer;
using nonlinear::Settings;

Formula formula_of(const PoleProblem<Jet>& problem, double distance) {
  return {.name = problem.name,
          .start = problem.start(distance),
          .parts = [&problem](const Jets& x) -> Parts {
            PoleParts<Jet> at = problem.parts(x);
            Jets H;
            if (problem.complement >= 0) H = {x[static_cast<std::size_t>(problem.complement)]};
            return {.objective = at.objective,
                    .equalities = std::move(at.equalities),
                    .inequalities = std::move(at.inequalities),
                    .G = std::move(at.G),
                    .H = std::move(H)};
          },
          .lower = problem.lower,
          .upper = problem.upper};
}

double error_of(const PoleProblem<Jet>& problem, const Answer& answer) {
  double error = 0.0;
  for (std::size_t j = 0; j < problem.solution.size(); ++j)
    error = std::max(error, std::abs(answer.x[j] - problem.solution[j]));
  return error;
}

TEST(NonlinearPoles, AreLeftWithin50LcqpsByTheExactHessian) {
  for (const auto& problem : pole_problems<Jet>()) {
    for (const double distance : kPoleDistances) {
      const Formula formula = formula_of(problem, distance);
      const auto answer = nonlinear::solve(problem_of(formula), nonlinear::open_ticks_in_process);
      ASSERT_TRUE(answer.has_value()) << problem.name << ": " << answer.error().message();
      EXPECT_EQ(answer->status, Status::solved) << problem.name << " from " << distance << answer->detail;
      EXPECT_LE(error_of(problem, *answer), 1e-6) << problem.name << " from " << distance;
      EXPECT_LE(answer->ticks, problem.most_lcqps) << problem.name << " from " << distance;
      EXPECT_EQ(answer->b_stationary, true) << problem.name << " from " << distance;
    }
  }
}

// Without second derivatives some end almost stationary or at the limit of iterations; none is called solved
// that is not.
TEST(NonlinearPoles, AreLeftByUpdatesOfTheCurvatureOrSayWhyNot) {
  int solved = 0, all = 0, within = 0;
  for (const auto& problem : pole_problems<Jet>()) {
    for (const double distance : kPoleDistances) {
      const Formula formula = formula_of(problem, distance);
      const auto answer = nonlinear::solve(problem_of(formula, false), nonlinear::open_ticks_in_process);
      ASSERT_TRUE(answer.has_value()) << problem.name << ": " << answer.error().message();
      if (is_solved(answer->status)) {
        EXPECT_EQ(objection(formula, *answer), "") << problem.name << " from " << distance;
      }
      ++all, within += answer->ticks <= problem.most_lcqps;
      if (answer->status == Status::solved) {
        ++solved;
        EXPECT_LE(error_of(problem, *answer), 5e-6) << problem.name << " from " << distance;
      } else {
        const bool says_why = answer->detail.find("stationary") != std::string::npos ||
                              answer->detail.find("KKT residual") != std::string::npos;
        EXPECT_TRUE(says_why) << problem.name << " from " << distance << ": " << answer->detail;
      }
    }
  }
  EXPECT_GE(solved, all - 3);
  EXPECT_GE(within, all - 4);
}

// Infinite values away from any bound: nothing can be moved.
TEST(NonlinearPoles, AStartWithoutAFiniteValueIsAnErrorThatNamesTheFunction) {
  const Formula formula{.name = "overflow",
                        .start = {1e-6},
                        .parts = [](const Jets& x) -> Parts { return {.objective = exp(1.0 / x[0]) + x[0]}; },
                        .lower = {0}};
  const auto answer = nonlinear::solve(problem_of(formula), nonlinear::open_ticks_in_process);
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().field, "values.objective");
}

/// A constant whose gradient and Hessian are wrong: every step is zero, and x is not stationary.
nonlinear::Problem constant(const double& slope, const double& curvature) {
  static const SparseMatrix pattern{1, 1, {0, 1}, {0}, {0}};
  nonlinear::Problem problem;
  problem.start = {0.0};
  problem.values = [](std::span<const double>) -> nonlinear::Values { return {.objective = 1.0}; };
  problem.derivatives = [&slope](std::span<const double>) -> nonlinear::Derivatives {
    return {.gradient = {&slope, 1}};
  };
  problem.hessian = [&curvature](std::span<const double>, const nonlinear::Multipliers&) {
    SparseMatrixView view = pattern.view();
    view.values = {&curvature, 1};
    return view;
  };
  return problem;
}

TEST(NonlinearPoles, AZeroStepIsSolvedOnlyWhereTheKktResidualIsWithinItsTolerance) {
  const auto status_of = [](double slope, double curvature) {
    const auto answer = nonlinear::solve(constant(slope, curvature), nonlinear::open_ticks_in_process);
    EXPECT_TRUE(answer.has_value());
    EXPECT_LE(answer->ticks, 10);
    EXPECT_EQ(answer->kkt_residual, slope);
    const bool zero = answer->detail.find("zero") != std::string::npos;
    EXPECT_TRUE(zero) << answer->detail;
    return answer->status;
  };
  EXPECT_EQ(status_of(1e-7, 1e6), Status::solved);
  EXPECT_EQ(status_of(5e-5, 1e6), Status::almost_solved);
  EXPECT_EQ(status_of(1.0, 1e15), Status::numerical_failure);
}

/// A session whose answers are bad once Q has fallen to a hundredth of its first size, as those of a scaling
/// that is kept may be.
class KeptScaling final : public nonlinear::Ticks {
 public:
  KeptScaling(std::unique_ptr<nonlinear::Ticks> ticks, double size) : ticks_(std::move(ticks)), size_(size) {}

  Expected<Solution> solve(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    auto solution = ticks_->solve(update, controls);
    if (!solution || 100.0 * std::abs(update.Q[0]) >= size_) return solution;
    solution->kkt_residual = 0.99 * std::abs(update.g[0]);
    for (double& z : solution->z) z *= 0.01;
    return solution;
  }

 private:
  std::unique_ptr<nonlinear::Ticks> ticks_;
  double size_;
};

TEST(NonlinearPoles, AnAnswerByAScalingOfOtherNumbersIsAskedForAgain) {
  const auto problems = pole_problems<Jet>();
  const Formula formula = formula_of(problems.front(), 1e-6);
  int sessions = 0;
  const auto open = [&](const ProblemView& view,
                        const Settings& settings) -> Expected<std::unique_ptr<nonlinear::Ticks>> {
    ++sessions;
    MARBLE_ASSIGN_OR_RETURN(auto ticks, nonlinear::open_ticks_in_process(view, settings));
    return std::make_unique<KeptScaling>(std::move(ticks), std::abs(view.Q.values[0]));
  };
  const auto answer = nonlinear::solve(problem_of(formula), open);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved) << answer->detail;
  EXPECT_NEAR(answer->x[0], 1.0, 1e-6);
  EXPECT_GT(sessions, 1);
  EXPECT_LE(answer->ticks, problems.front().most_lcqps);
}

// Roots, powers and logarithms at the bounds of their arguments: derivatives that are infinite, or no
// numbers.
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
