// What is balanced in the scaled problem, and what has a digit in the user's units.
#include <gtest/gtest.h>

#include "proof/balance.h"

namespace marble {
namespace {

// min g z for one free variable, whose unit is 1 / scale of the user's.
struct Slope {
  Slope(double gradient, double scale) : g{gradient}, problem(scaled(g)) {
    problem.variable_scale[0] = scale;
  }
  static ScaledProblem scaled(const std::vector<double>& g) {
    ProblemView view;
    view.g = g;
    ScaledProblem problem = scale(Problem::create(view).value(), 0);
    return problem;
  }
  [[nodiscard]] Images at_zero() const {
    Images images(problem);
    images.evaluate(problem, Iterate(problem));
    return images;
  }

  std::vector<double> g;
  ScaledProblem problem;
};

TEST(Balance, AScaledResidualWithinTheToleranceMayHaveNoDigitInTheUsersUnits) {
  const Slope slope(1e-5, 1e-8);
  const Images images = slope.at_zero();
  const Iterate x(slope.problem);
  EXPECT_TRUE(is_balanced(slope.problem, {}, images, x));
  EXPECT_FALSE(is_balanced_in_user_units(slope.problem, images, x)) << "1000 of 1000";
}

TEST(Balance, WhatIsSmallInTheUsersUnitsIsBalancedThere) {
  for (const double scale : {1.0, 1e4}) {
    const Slope slope(1e-5, scale);
    EXPECT_TRUE(is_balanced_in_user_units(slope.problem, slope.at_zero(), Iterate(slope.problem))) << scale;
  }
}

TEST(Balance, AResidualIsJudgedAgainstTheTermsOfItsOwnSum) {
  Slope slope(1e-5, 1e-8);
  Images images = slope.at_zero();
  images.stationarity[0] = 1e-7;  // what is left of 1e-5
  EXPECT_TRUE(is_balanced_in_user_units(slope.problem, images, Iterate(slope.problem)));
}

}  // namespace
}  // namespace marble
