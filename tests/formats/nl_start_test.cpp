// Where a nonlinear .nl file begins: functions without a value at a bound.
#include <gtest/gtest.h>

#include <cmath>

#include "nl/nl_nonlinear.h"
#include "nl_writer.h"

namespace marble::formats {
namespace {

using testing::NlWriter;

enum Operator { kPlus = 0, kMinus = 1, kTimes = 2, kDivide = 3, kNegate = 16, kLog = 43, kSum = 54 };

/// min x − log x over [low, high] from `start`, or from no start at all.
std::string logarithm(double low, double high, const double* start = nullptr) {
  NlWriter nl(false, 1, 0, 1);
  nl.key('O').integer(0).integer(0).operation(kNegate).operation(kLog).variable(0);
  if (start != nullptr) nl.key('x').integer(1).entry(0, *start);
  nl.key('b').between(low, high);
  nl.key('G').integer(0).integer(1).entry(0, 1.0);
  return nl.content();
}

/// min x + f s.t. 1 / f >= 0.1 where f is x, or a sum of 80 of it over 80: a long defined variable.
std::string reciprocal(bool defined) {
  NlWriter nl(false, 1, 1, 1);
  if (defined) {
    nl.key('V').integer(1).integer(0).integer(0).operation(kSum).integer(80);
    for (int i = 0; i < 80; ++i) nl.operation(kDivide).constant(1.0).variable(0);
    nl.key('C').integer(0).variable(1);
  } else {
    nl.key('C').integer(0).operation(kDivide).constant(1.0).variable(0);
  }
  nl.key('O').integer(0).integer(0).constant(0.0);
  nl.key('r').at_least(0.1).key('b').between(0.0, 10.0);
  nl.key('J').integer(0).integer(1).entry(0, 0.0);
  nl.key('G').integer(0).integer(1).entry(0, 1.0);
  return nl.content();
}

TEST(NlStart, WhatIsAtABoundWithoutAValueIsMovedOffIt) {
  const auto start_of = [](const std::string& content) {
    const auto nl = parse_nonlinear_nl(content, "test");
    EXPECT_TRUE(nl.has_value()) << nl.error().message();
    return nl ? nl->problem.start : std::vector<double>{NAN};
  };
  const double at_bound = 0.0, below = -3.0, inside = 0.5, above = 12.0;
  EXPECT_EQ(start_of(logarithm(0.0, 10.0)), std::vector{0.01}) << "no start is 0";
  EXPECT_EQ(start_of(logarithm(0.0, 10.0, &at_bound)), std::vector{0.01});
  EXPECT_EQ(start_of(logarithm(0.0, 10.0, &below)), std::vector{0.01}) << "outside is at the bound";
  EXPECT_EQ(start_of(logarithm(0.0, 0.5)), std::vector{0.005}) << "a hundredth of a short range";
  EXPECT_EQ(start_of(logarithm(0.0, 10.0, &inside)), std::vector{0.5}) << "a good start stays";
  EXPECT_EQ(start_of(logarithm(0.0, 10.0, &above)), std::vector{10.0}) << "so does one at a good bound";
  EXPECT_EQ(start_of(reciprocal(false)), std::vector{0.01});
  const std::vector<double> lifted = start_of(reciprocal(true));
  ASSERT_EQ(lifted.size(), 2U);
  EXPECT_EQ(lifted[0], 0.01);
  EXPECT_NEAR(lifted[1], 80.0 / 0.01, 1e-6) << "what is defined by it moves with it";
}

TEST(NlStart, WhereThatDoesNotHelpTheErrorIsOfTheFilesOwnStart) {
  for (const auto& [low, high] : {std::pair{-1.0, 10.0}, std::pair{-1.0, -0.5}, std::pair{0.0, 0.0}}) {
    const auto nl = parse_nonlinear_nl(logarithm(low, high), "test", {{}, {"x"}});
    ASSERT_FALSE(nl.has_value()) << low << ' ' << high;
    EXPECT_EQ(nl.error().message(),
              "x: must be a point where every function has a value: there is none at the initial point, in "
              "the objective");
  }
}

}  // namespace
}  // namespace marble::formats
