#include "nl/nl_answer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "marble/solver.h"
#include "nl/nl_nonlinear.h"
#include "nl/nl_tokens.h"
#include "nl/sol_file.h"
#include "nl_writer.h"

namespace marble::formats {
namespace {

// What AMPL receives of a solution: dual values, reduced costs, and the .sol file they stand in.
using testing::NlWriter;

struct Sides {
  double at_least = 1.0, at_most = 0.5, equal = 2.0, low = -3.0, high = -2.0, pair = 0.25, upper_pair = 0.5;
  double bound = 4.0;
};

/// min (or max of the negative) Σ (xᵢ − wᵢ)² with rows of every kind, a pair at a lower bound, one at an
/// upper bound, and one with regard to both bounds.
std::string every_kind(const Sides& s, bool maximize) {
  constexpr double kWanted[] = {0.0, 2.0, 0.5, -5.0, -1.0, 1.0, 9.0, 3.0};
  NlWriter nl(false, 8, 7, 1);
  for (int row = 0; row < 7; ++row) {
    nl.key('C').integer(row);
    row == 4 ? nl.constant(-s.pair) : row == 5 ? nl.constant(s.upper_pair) : nl.constant(0.0);
  }
  nl.key('O').integer(0).integer(maximize ? 1 : 0);
  if (maximize) nl.operation(16);
  nl.operation(54).integer(8);
  for (int j = 0; j < 8; ++j) nl.operation(5).operation(1).variable(j).constant(kWanted[j]).constant(2.0);
  nl.key('r').at_least(s.at_least).at_most(s.at_most).equal(s.equal).between(s.low, s.high);
  nl.complements(1, 4).complements(2, 5).complements(3, 6);
  nl.key('b').free().free().free().free().at_least(0.5).at_most(2.0).between(0.0, s.bound).at_most(1.5);
  nl.key('J').integer(0).integer(1).entry(0, 1.0);
  nl.key('J').integer(1).integer(1).entry(1, 1.0);
  nl.key('J').integer(2).integer(1).entry(2, 1.0);
  nl.key('J').integer(3).integer(1).entry(3, 1.0);
  nl.key('J').integer(4).integer(2).entry(0, 1.0).entry(4, 1.0);
  nl.key('J').integer(5).integer(2).entry(1, 1.0).entry(5, -1.0);
  nl.key('J').integer(6).integer(1).entry(7, 1.0);
  nl.key('G').integer(0).integer(8);
  for (int j = 0; j < 8; ++j) nl.entry(j, 0.0);
  return nl.content();
}

NlProblem read(const Sides& sides, bool maximize) {
  auto nl = parse_nl_problem(every_kind(sides, maximize), "every kind");
  EXPECT_TRUE(nl.has_value()) << nl.error().message();
  return std::move(*nl);
}

double optimum(const Sides& sides, bool maximize) {
  const NlProblem nl = read(sides, maximize);
  const Solution s = solve_in_process(nl.file.problem.view()).value();
  EXPECT_TRUE(is_solved(s.status)) << s.detail;
  return s.objective * (maximize ? -1.0 : 1.0);
}

TEST(NlAnswer, DualValuesAreDerivativesOfTheOptimumByTheRightHandSides) {
  constexpr double kStep = 1e-4;
  for (const bool maximize : {false, true}) {
    const NlProblem nl = read({}, maximize);
    const Solution s = solve_in_process(nl.file.problem.view()).value();
    std::vector<double> duals = sums(nl.row_duals, 7, MultiplierView::of(s));
    const double sign = maximize ? -1.0 : 1.0;
    const auto slope = [&](double Sides::*side) {
      Sides more, less;
      more.*side += kStep;
      less.*side -= kStep;
      return (optimum(more, maximize) - optimum(less, maximize)) / (2.0 * kStep);
    };
    EXPECT_NEAR(sign * duals[0], slope(&Sides::at_least), 1e-6);
    EXPECT_NEAR(sign * duals[1], slope(&Sides::at_most), 1e-6);
    EXPECT_NEAR(sign * duals[2], slope(&Sides::equal), 1e-6);
    EXPECT_NEAR(sign * duals[3], slope(&Sides::low), 1e-6);
    EXPECT_NEAR(sign * duals[4], slope(&Sides::pair), 1e-6);
    EXPECT_NEAR(sign * duals[5], -slope(&Sides::upper_pair), 1e-6) << "a constant on the row's own side";
    for (const int row : {0, 1, 2, 3}) EXPECT_GT(std::abs(duals[row]), 0.1) << "a row that counts: " << row;
    EXPECT_NEAR(sign * sums(nl.reduced_costs, 8, MultiplierView::of(s))[6], slope(&Sides::bound), 1e-6);
  }
}

TEST(NlAnswer, AnAnswerGivenBackIsFoundAtOnce) {
  for (const bool maximize : {false, true}) {
    NlProblem nl = read({}, maximize);
    const Solution cold = solve_in_process(nl.file.problem.view()).value();
    const auto multipliers = MultiplierView::of(cold);
    nl.file.problem.initial_z = cold.z;
    nl.initial_duals = sums(nl.row_duals, 7, multipliers);
    if (maximize) {
      for (double& dual : nl.initial_duals) dual = -dual;  // AMPL's, of a maximum
    }
    const Solution start = initial_answer(nl);
    EXPECT_NEAR(start.objective, cold.objective, 1e-9);
    const auto reported = sums(nl.reduced_costs, 8, MultiplierView::of(start));
    const auto known = sums(nl.reduced_costs, 8, multipliers);
    for (std::size_t j = 0; j < 8; ++j) EXPECT_NEAR(reported[j], known[j], 1e-6) << j;
    const Solution warm = solve_in_process(nl.file.problem.view(), {}, {.warm_start = &start}).value();
    EXPECT_EQ(warm.status, Status::solved);
    EXPECT_NEAR(warm.objective, cold.objective, 1e-9);
    EXPECT_LE(warm.factorizations, 2);
  }
}

TEST(NlAnswer, SegmentDIsRead) {
  NlWriter nl(true, 1, 2, 0);
  nl.key('C').integer(0).constant(0.0);
  nl.key('C').integer(1).constant(0.0);
  nl.key('d').integer(1).entry(1, -2.5);
  nl.key('r').at_least(0.0).at_most(1.0);
  nl.key('b').free();
  nl.key('J').integer(0).integer(1).entry(0, 1.0);
  nl.key('J').integer(1).integer(1).entry(0, 1.0);
  const auto read = parse_nl_problem(nl.content(), "d");
  ASSERT_TRUE(read.has_value()) << read.error().message();
  EXPECT_EQ(read->initial_duals, (std::vector<double>{0.0, -2.5}));
}

TEST(NlAnswer, AFaultNamesItsConstraintOrVariable) {
  NlWriter nl(false, 1, 2, 0);
  nl.key('C').integer(0).constant(0.0);
  nl.key('C').integer(1).operation(44).variable(0);
  nl.key('r').at_least(0.0).at_least(0.0);
  nl.key('b').free();
  const NlNames names{{"flow", "heat[3]"}, {"T"}};
  const auto nonlinear = parse_nl_problem(nl.content(), "no", names);
  ASSERT_FALSE(nonlinear.has_value());
  EXPECT_EQ(nonlinear.error().value, "exp");
  EXPECT_NE(nonlinear.error().message().find("in constraint heat[3] (C1)"), std::string::npos)
      << nonlinear.error().message();

  NlWriter crossed(false, 1, 0, 0);
  crossed.key('b').between(2.0, 1.0);
  const auto bounds = parse_nl_problem(crossed.content(), "no", names);
  ASSERT_FALSE(bounds.has_value());
  EXPECT_NE(bounds.error().message().find("of variable T (v0)"), std::string::npos)
      << bounds.error().message();

  const auto whole = parse_nl_problem(NlWriter(false, 1, 0, 0, 1).content(), "no", names);
  ASSERT_FALSE(whole.has_value());
  EXPECT_NE(whole.error().message().find("of variable T (v0)"), std::string::npos) << whole.error().message();
}

TEST(SolFile, IsWrittenAsAmplReadsIt) {
  SolFile sol{.message = "marble: solved\n\nobjective 3",
              .options = {1, 1, 0},
              .constraints = 2,
              .variables = 3,
              .duals = {0.1, -2.0},
              .primals = {1.0, 0.0, 1e-300},
              .code = 0,
              .suffixes = {{"gap", SolSuffix::Of::problem, {{0, 0.5}}}}};
  EXPECT_EQ(sol_text(sol),
            "marble: solved\nobjective 3\n\nOptions\n3\n1\n1\n0\n2\n2\n3\n3\n0.1\n-2\n1\n0\n1e-300\n"
            "objno 0 0\nsuffix 7 1 4 0 0\ngap\n0 0.5\n");
  sol.code.reset();
  sol.vb_tolerance = 0.25;
  EXPECT_EQ(sol_text(sol),
            "marble: solved\nobjective 3\n\nOptions\n5\n1\n1\n0\n2\n2\n3\n3\n0.25\n0.1\n-2\n1\n0\n1e-300\n");
}

TEST(SolFile, RepeatsTheOptionsOfTheHeader) {
  const auto header = [](const std::string& first) { return NlTokens(first + "\n").header(); };
  EXPECT_EQ(header("g3 1 1 0\t# problem x").options, (std::vector<int>{1, 1, 0}));
  EXPECT_EQ(header("g3 1 3 0 1e-5").vb_tolerance, 1e-5);
  EXPECT_TRUE(header("g").options.empty());
}

// Where a nonlinear .nl file begins: functions without a value at a bound.
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
