// AMPL's .nl files whose functions bend: values, derivatives, conditions, and files that somebody broke.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "assembler.h"
#include "marble/nonlinear.h"
#include "nl/nl_nonlinear.h"
#include "nl/nl_problem.h"
#include "nl_writer.h"

namespace marble::formats {
namespace {

using testing::NlWriter;

/// Every operator, defined variables that use each other, every kind of row and of condition, a maximum. The
/// rows name a variable less than they have in J, and columns come in any order.
std::string bent(bool binary) {
  NlWriter nl(binary, 4, 6, 1);
  nl.key('V').integer(4).integer(1).integer(0).entry(2, 3.0);  // v4 = 3 x2 + exp(x0)
  nl.operation(44).variable(0);
  nl.key('V').integer(7).integer(0).integer(0);  // v7 = v4 sin(x1)
  nl.operation(2).variable(4).operation(41).variable(1);
  nl.key('C').integer(0).operation(54).integer(10);
  for (const int function : {37, 38, 40, 45, 46, 49, 50}) nl.operation(function).variable(0);
  nl.operation(47).operation(2).constant(0.1).variable(1);
  nl.operation(51).operation(2).constant(0.1).variable(2);
  nl.operation(53).operation(2).constant(0.1).variable(3);
  nl.key('C')
      .integer(1)
      .operation(0)
      .variable(7)
      .operation(3)
      .variable(1)
      .operation(0)
      .constant(9.0)
      .variable(3);
  nl.key('C').integer(2).operation(54).integer(2).operation(39).variable(2).operation(43).variable(3);
  nl.key('C').integer(3).operation(5).variable(2).variable(0);
  nl.key('C').integer(4).operation(35).operation(22).variable(0).constant(7.0);  // x0 < 7 ? x1^3 : log10(x2)
  nl.operation(76).variable(1).constant(3.0).operation(42).variable(2);
  nl.key('C').integer(5).operation(11).integer(2).operation(52).operation(0).constant(2.0).variable(2);
  nl.operation(48).constant(90.0).variable(3);
  nl.key('O').integer(0).integer(1).operation(1);  // maximize 2^x1 - x3^2 |x2| - max(x0, -9) + x2
  nl.operation(1).operation(78).constant(2.0).variable(1).operation(2).operation(77).variable(3);
  nl.operation(15).variable(2).operation(12).integer(2).variable(0).constant(-9.0);
  nl.key('x').integer(4).entry(0, 0.3).entry(1, 0.4).entry(2, 1.5).entry(3, 0.8);
  nl.key('r')
      .between(-1.0, 50.0)
      .equal(6.0)
      .at_most(9.0)
      .complements(3, 1)
      .complements(1, 2)
      .complements(2, 3);
  nl.key('b').between(0.0, 3.0).between(0.0, 2.0).at_least(0.5).between(0.1, 4.0);
  nl.key('k').integer(3).line().integer(0).line().integer(0).line().integer(0);
  nl.key('J').integer(0).integer(3).entry(3, 0.0).entry(0, 1.0).entry(1, 0.0);
  nl.key('J').integer(5).integer(1).entry(3, -2.0);
  nl.key('J').integer(2).integer(1).entry(0, 0.5);
  nl.key('G').integer(0).integer(1).entry(2, 1.0);
  return nl.content();
}

NlNonlinear read(const std::string& content) {
  auto nl = parse_nonlinear_nl(content, "test");
  if (!nl) throw std::runtime_error(nl.error().message());
  return std::move(*nl);
}

std::vector<double> numbers(std::span<const double> values) { return {values.begin(), values.end()}; }

/// All that the loop would ever ask, at x.
std::vector<double> everything_at(const nonlinear::Problem& p, const std::vector<double>& x) {
  const nonlinear::Values v = p.values(x);
  std::vector<double> all = {v.objective};
  nonlinear::Multipliers m{.equalities = std::vector<double>(v.equalities.size(), 0.7),
                           .inequalities = std::vector<double>(v.inequalities.size(), 0.3),
                           .G = std::vector<double>(v.G.size(), -0.2),
                           .H = std::vector<double>(v.H.size(), 0.4),
                           .bounds = {}};
  const auto add = [&all](std::span<const double> values) {
    all.insert(all.end(), values.begin(), values.end());
  };
  for (const auto& part : {v.equalities, v.inequalities, v.G, v.H}) add(part);
  const nonlinear::Derivatives d = p.derivatives(x);
  add(d.gradient);
  for (const auto& part : {d.equalities, d.inequalities, d.G, d.H}) add(part.values);
  if (p.hessian) add(p.hessian(x, m).values);
  return all;
}

TEST(NlFunctions, DerivativesOfEveryOperatorAgreeWithDifferences) {
  for (const bool binary : {false, true}) {
    const NlNonlinear nl = read(bent(binary));
    ASSERT_EQ(nl.problem.start.size(), 6U) << "the condition with both bounds brings two variables";
    for (const double shift : {0.0, 0.05, 0.2}) {
      std::vector<double> x = nl.problem.start;
      for (double& value : x) value += shift;
      const auto agree = nonlinear::check_derivatives(nl.problem, x, 1e-6);
      EXPECT_TRUE(agree.has_value()) << agree.error().message();
    }
  }
}

/// The Hessian at x, asked for after the functions were elsewhere, against differences of the Lagrangian's
/// gradient.
void expect_second_derivatives(const nonlinear::Problem& p, const std::vector<double>& x,
                               const nonlinear::Multipliers& m, double tolerance) {
  const std::size_t n = x.size();
  const auto gradient = [&](const std::vector<double>& at) {
    const nonlinear::Derivatives d = p.derivatives(at);
    std::vector<double> sum = numbers(d.gradient);
    const auto add = [&](const SparseMatrixView& J, const std::vector<double>& by, double sign) {
      ASSERT_EQ(static_cast<std::size_t>(J.rows), by.size());
      for (std::size_t j = 0; j < n; ++j) {
        for (Index k = J.column_pointers[j]; k < J.column_pointers[j + 1]; ++k)
          sum[j] += sign * J.values[k] * by[J.row_indices[k]];
      }
    };
    add(d.equalities, m.equalities, 1.0), add(d.inequalities, m.inequalities, -1.0);
    add(d.G, m.G, -1.0), add(d.H, m.H, -1.0);
    return sum;
  };
  constexpr double kStep = 1e-6;
  std::vector<std::vector<double>> differences(n, std::vector<double>(n)), dense = differences;
  for (std::size_t j = 0; j < n; ++j) {
    std::vector<double> ahead = x, behind = x;
    ahead[j] += kStep, behind[j] -= kStep;
    const std::vector<double> after = gradient(ahead), before = gradient(behind);
    for (std::size_t i = 0; i < n; ++i) differences[i][j] = (after[i] - before[i]) / (2 * kStep);
  }
  const SparseMatrixView H = p.hessian(x, m);
  for (std::size_t j = 0; j < n; ++j) {
    for (Index k = H.column_pointers[j]; k < H.column_pointers[j + 1]; ++k)
      dense[H.row_indices[k]][j] = dense[j][H.row_indices[k]] = H.values[k];
  }
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i)
      EXPECT_NEAR(dense[i][j], differences[i][j], tolerance * (1 + std::abs(dense[i][j]))) << i << ' ' << j;
  }
}

TEST(NlFunctions, SecondDerivativesAgreeWithDifferencesOfTheFirst) {
  const NlNonlinear nl = read(bent(false));
  expect_second_derivatives(nl.problem, nl.problem.start,
                            {.equalities = {0.3, -0.4},
                             .inequalities = {0.5, 0.25, 0.75},
                             .G = {0.1, 0.2, 0.3, 0.6},
                             .H = {0.4, 0.3, 0.2, 0.1},
                             .bounds = {}},
                            1e-6);
}

/// Five variables, three defined ones and three rows of expressions made by chance, of functions without
/// poles.
class ByChance {
 public:
  explicit ByChance(unsigned seed) : random_(seed) {}

  std::string content() {
    NlWriter nl(random_() % 2 == 0, kVariables, 3, 1);
    for (; defined_ < 3; ++defined_) {
      nl.key('V').integer(kVariables + defined_).integer(1).integer(0).entry(defined_, 0.5);
      expression(nl, 3);
    }
    for (int row = 0; row < 3; ++row) expression(nl.key('C').integer(row), 5);
    expression(nl.key('O').integer(0).integer(0), 5);
    nl.key('x').integer(kVariables);
    for (int j = 0; j < kVariables; ++j) nl.entry(j, 0.01 * static_cast<double>(random_() % 150) - 0.7);
    nl.key('r').equal(0.0).at_least(0.0).complements(3, 4);
    nl.key('b').free().free().free().free().between(-2.0, 2.0);
    return nl.content();
  }

 private:
  static constexpr int kVariables = 5;

  void expression(NlWriter& nl, int depth) {
    if (depth == 0) {
      const auto leaf = static_cast<int>(random_() % (kVariables + 2));
      if (leaf == kVariables) return void(nl.constant(0.25 * static_cast<double>(random_() % 9) - 1.0));
      if (leaf < kVariables || defined_ == 0) return void(nl.variable(leaf % kVariables));
      return void(nl.variable(kVariables + static_cast<int>(random_() % static_cast<unsigned>(defined_))));
    }
    switch (random_() % 8) {
      case 0:
      case 1: {
        constexpr int kFunctions[] = {37, 41, 46, 49, 50};  // tanh, sin, cos, atan, asinh
        nl.operation(kFunctions[random_() % 5]);
        return expression(nl, depth - 1);
      }
      case 2:  // over 2 + its square
        nl.operation(3);
        expression(nl, depth - 1);
        nl.operation(0).constant(2.0).operation(77);
        return expression(nl, depth - 1);
      case 3:
        nl.operation(5).operation(46);  // cos^3
        expression(nl, depth - 1);
        return void(nl.constant(3.0));
      case 4: {
        const int count = 1 + static_cast<int>(random_() % 4);
        nl.operation(54).integer(count);
        for (int i = 0; i < count; ++i) expression(nl, depth - 1);
        return;
      }
      case 5:
        nl.operation(16);
        return expression(nl, depth - 1);
      default:
        nl.operation(random_() % 2 == 0 ? 2 : 1);
        expression(nl, depth - 1);
        return expression(nl, random_() % 2 == 0 ? depth - 1 : 0);
    }
  }

  std::mt19937 random_;
  int defined_ = 0;
};

TEST(NlFunctions, DerivativesOfExpressionsMadeByChanceAgreeWithDifferencesOrAreNotGiven) {
  int without = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    const NlNonlinear nl = read(ByChance(seed).content());
    std::vector<double> x = nl.problem.start;
    for (double& value : x) value += 0.03;
    const auto agree = nonlinear::check_derivatives(nl.problem, x, 1e-5);
    EXPECT_TRUE(agree.has_value()) << agree.error().message();
    if (!nl.problem.hessian) {
      ++without;
      continue;
    }
    const nonlinear::Values there = nl.problem.values(x);
    nonlinear::Multipliers m{.equalities = std::vector<double>(there.equalities.size(), 0.3),
                             .inequalities = std::vector<double>(there.inequalities.size(), 0.5),
                             .G = std::vector<double>(there.G.size(), 0.2),
                             .H = std::vector<double>(there.H.size(), 0.4),
                             .bounds = {}};
    expect_second_derivatives(nl.problem, x, m, 1e-5);
  }
  EXPECT_LE(without, 20) << "models whose second derivatives the library has wrong";
}

TEST(NlFunctions, ALongDefinedVariableIsAVariableThatBeginsAtItsValue) {
  NlWriter nl(false, 1, 1, 1);
  nl.key('V').integer(1).integer(0).integer(0).operation(54).integer(80);
  for (int i = 0; i < 80; ++i) nl.operation(41).variable(0);
  nl.key('C').integer(0).operation(2).variable(1).variable(1);
  nl.key('O').integer(0).integer(0).operation(44).variable(1);
  nl.key('x').integer(1).entry(0, 0.5);
  nl.key('r').at_most(9.0).key('b').free();
  const NlNonlinear read_one = read(nl.content());
  const double value = 80.0 * std::sin(0.5);
  ASSERT_EQ(read_one.problem.start.size(), 2U);
  EXPECT_NEAR(read_one.problem.start[1], value, 1e-12);
  const nonlinear::Values there = read_one.problem.values(read_one.problem.start);
  EXPECT_NEAR(there.objective, std::exp(value), 1e-9 * std::exp(value));
  ASSERT_EQ(there.equalities.size(), 1U);
  EXPECT_NEAR(there.equalities[0], 0.0, 1e-12);
  EXPECT_EQ(read_one.variables, 1);
  for (const DualTerm& term : read_one.row_duals) EXPECT_EQ(term.of, 0) << "its row is not the file's";
}

TEST(NlFunctions, TextAndBinaryHaveTheSameBits) {
  const NlNonlinear text = read(bent(false)), binary = read(bent(true));
  EXPECT_EQ(text.problem.start, binary.problem.start);
  EXPECT_EQ(everything_at(text.problem, text.problem.start),
            everything_at(binary.problem, text.problem.start));
}

TEST(NlFunctions, FilesDoNotDisturbEachOther) {
  const NlNonlinear one = read(bent(false));
  const std::vector<double> before = everything_at(one.problem, one.problem.start);
  std::vector<double> elsewhere = one.problem.start;
  elsewhere[0] += 0.5;
  {
    const NlNonlinear other = read(bent(true));
    EXPECT_NE(everything_at(other.problem, elsewhere), before);
    EXPECT_EQ(everything_at(one.problem, one.problem.start), before);
  }
  EXPECT_EQ(everything_at(one.problem, one.problem.start), before);
}

/// min (x0 - 3)^2  s.t. log(x1) <= 2, sqrt(x0) >= 0.1 where both begin at `start`.
std::string with_a_domain(double start) {
  NlWriter nl(false, 2, 2, 1);
  nl.key('C').integer(0).operation(43).variable(1);
  nl.key('C').integer(1).operation(39).variable(0);
  nl.key('O').integer(0).integer(0).operation(5).operation(1).variable(0).constant(3.0).constant(2.0);
  nl.key('x').integer(2).entry(0, 1.0).entry(1, start);
  nl.key('r').at_most(2.0).at_least(0.1);
  nl.key('b').free().free();
  nl.key('J').integer(0).integer(1).entry(1, 0.0);
  nl.key('J').integer(1).integer(1).entry(0, 0.0);
  nl.key('G').integer(0).integer(1).entry(0, 0.0);
  return nl.content();
}

TEST(NlFunctions, WhatHasNoValueIsNoNumberThereAndOneAgainElsewhere) {
  const NlNonlinear nl = read(with_a_domain(1.0));
  const std::vector<double> good = {1.0, 1.0}, bad = {1.0, -1.0};
  const std::vector<double> before = everything_at(nl.problem, good);
  const nonlinear::Values there = nl.problem.values(bad);
  EXPECT_EQ(there.objective, 4.0);
  ASSERT_EQ(there.inequalities.size(), 2U);
  EXPECT_TRUE(std::isnan(there.inequalities[0]));
  EXPECT_NEAR(there.inequalities[1], 0.9, 1e-15) << "only the row that has none";
  EXPECT_TRUE(std::isnan(nl.problem.derivatives(bad).inequalities.values[0]));
  EXPECT_EQ(everything_at(nl.problem, good), before);
}

TEST(NlFunctions, AStartWithoutAValueIsAnErrorThatNamesTheConstraint) {
  const auto nl = parse_nonlinear_nl(with_a_domain(-1.0), "test", {{"heat", "flow"}, {}});
  ASSERT_FALSE(nl.has_value());
  EXPECT_EQ(nl.error().message(),
            "x: must be a point where every function has a value: there is none at the initial point, in "
            "constraint heat (C0)");
}

/// Linear, with every kind of condition: "5 k i" of variables with the bounds that it names.
std::string every_condition() {
  NlWriter nl(false, 6, 6, 1);
  for (int row = 0; row < 6; ++row) nl.key('C').integer(row).constant(0.25 * row);
  nl.key('O').integer(0).integer(0).constant(0.0);
  nl.key('x').integer(6);
  for (int j = 0; j < 6; ++j) nl.entry(j, 0.5 + 0.1 * j);
  nl.key('r').complements(1, 0).complements(2, 1).complements(3, 2).complements(0, 3).complements(1, 4);
  nl.complements(1, 5);
  nl.key('b').at_least(0.25).at_most(2.0).between(0.0, 3.0).free().between(0.0, 5.0).equal(1.0);
  nl.key('k').integer(5);
  for (int j = 0; j < 5; ++j) nl.line().integer(6 * (j + 1));
  for (int row = 0; row < 6; ++row) {
    nl.key('J').integer(row).integer(6);
    for (int j = 0; j < 6; ++j) nl.entry(j, 1.0 + row - 0.5 * j);
  }
  return nl.content();
}

// What the other reader makes an LCQP of, at a point: M z + offset.
std::vector<double> at_point(const SparseMatrix& M, std::vector<double> offset,
                             const std::vector<double>& z) {
  for (std::size_t j = 0; j < z.size(); ++j) {
    for (Index k = M.column_pointers[j]; k < M.column_pointers[j + 1]; ++k)
      offset[static_cast<std::size_t>(M.row_indices[k])] += M.values[static_cast<std::size_t>(k)] * z[j];
  }
  return offset;
}

TEST(NlFunctions, ConditionsMeanWhatTheyMeanInALinearFile) {
  const NlNonlinear nl = read(every_condition());
  const NlProblem linear = parse_nl_problem(every_condition(), "test").value();
  const OwnedProblem& p = linear.file.problem;
  const std::vector<double>& z = p.initial_z;
  EXPECT_EQ(nl.problem.start, z);
  const nonlinear::Values there = nl.problem.values(z);
  const auto expect_near = [](std::span<const double> found, std::span<const double> wanted) {
    ASSERT_EQ(found.size(), wanted.size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], wanted[i], 1e-12) << i;
  };
  expect_near(there.G, at_point(p.L, p.l, z));
  expect_near(there.H, at_point(p.R, p.r, z));
  // Rows come before bounds there; here bounds are apart.
  const std::vector<double> equalities = at_point(p.A, p.b, z), inequalities = at_point(p.C, p.d, z);
  expect_near(there.equalities, std::span(equalities).first(there.equalities.size()));
  expect_near(there.inequalities, std::span(inequalities).first(there.inequalities.size()));
  EXPECT_EQ(nl.problem.lower[2], -kInfinity) << "its bounds are the pairs'";
  EXPECT_EQ(nl.problem.upper[4], 5.0) << "a bound that the condition does not name";
  EXPECT_EQ(nl.problem.lower[5], 1.0);
  EXPECT_EQ(nl.problem.upper[5], 1.0);
}

std::string of_one_row(const std::function<void(NlWriter&)>& body, int integers = 0) {
  NlWriter nl(false, 2, 1, 1, integers);
  body(nl.key('C').integer(0));
  nl.key('O').integer(0).integer(0).constant(0.0);
  nl.key('r').at_least(0.0);
  nl.key('b').free().free();
  return nl.content();
}

TEST(NlFunctions, WhatIsNotTakenIsRefusedWithItsReasonAndPlace) {
  const std::pair<std::string, const char*> cases[] = {
      {of_one_row([](NlWriter& nl) { nl.operation(13).variable(0); }),
       "o13 = floor: is an operator that no smooth model has in line 11, in constraint C0"},
      {of_one_row([](NlWriter& nl) { nl.operation(64).integer(2).constant(1.0); }),
       "o64 = piecewise linear: is an operator that no smooth model has in line 11, in constraint C0"},
      {of_one_row([](NlWriter& nl) { nl.operation(22).variable(0).constant(1.0); }),
       "o22: is an operator that no smooth model has in line 11, in constraint C0"},
      {of_one_row([](NlWriter& nl) { nl.operation(35).variable(0); }),
       "o35: must ask for a comparison in line 12, in constraint C0"},
      {of_one_row([](NlWriter& nl) { nl.operation(44).variable(2); }),
       "v = 2: is no variable in line 12, in constraint C0"},
      {of_one_row([](NlWriter& nl) { nl.operation(44).constant(std::nan("")); }),
       "number = nan: must be finite in line 12, in constraint C0"},
      {of_one_row([](NlWriter& nl) { nl.operation(44).variable(0); }, 1),
       "header = 1 integer variables: must be none: not a smooth model in line 10, of variable v1"},
  };
  for (const auto& [content, reason] : cases) {
    const auto nl = parse_nonlinear_nl(content, "test");
    ASSERT_FALSE(nl.has_value()) << reason;
    EXPECT_EQ(nl.error().message(), reason);
  }
}

TEST(NlFunctions, ExpressionsNestedBeyondReasonAreRefusedNotFollowed) {
  for (const auto& [depth, taken] : {std::pair{7'000, true}, std::pair{20'000, false}}) {
    const std::string content = of_one_row([depth = depth](NlWriter& nl) {
      for (int i = 0; i < depth; ++i) nl.operation(41);
      nl.variable(0);
    });
    const auto nl = parse_nonlinear_nl(content, "test");
    ASSERT_EQ(nl.has_value(), taken);
    if (taken) {
      EXPECT_TRUE(std::isfinite(everything_at(nl->problem, {0.5, 0.5})[1]));
    }
  }
}

TEST(NlFunctions, AShortFileMayNotAskForEndlessSecondDerivatives) {
  constexpr int kVariables = 6000;
  NlWriter nl(true, kVariables, 0, 1);
  nl.key('O').integer(0).integer(0).operation(44).operation(54).integer(kVariables);
  for (int j = 0; j < kVariables; ++j) nl.variable(j);
  nl.key('b');
  for (int j = 0; j < kVariables; ++j) nl.free();
  const auto read = parse_nonlinear_nl(nl.content(), "test");
  ASSERT_FALSE(read.has_value());
  EXPECT_NE(read.error().message().find("36000000 second derivatives: must have no more than"),
            std::string::npos)
      << read.error().message();
}

TEST(NlFunctions, ConstantsWithoutAValueAreNoNumberAndNoCrash) {
  const std::function<void(NlWriter&)> bodies[] = {
      [](NlWriter& nl) { nl.operation(43).constant(-1.0); },                    // log(-1)
      [](NlWriter& nl) { nl.operation(3).constant(1.0).constant(0.0); },        // 1 / 0
      [](NlWriter& nl) { nl.operation(5).constant(0.0).constant(-1.0); },       // 0^-1
      [](NlWriter& nl) { nl.operation(5).constant(-8.0).constant(0.5); },       // (-8)^0.5
      [](NlWriter& nl) { nl.operation(44).constant(1e6); },                     // exp(1e6)
      [](NlWriter& nl) { nl.operation(3).variable(0).constant(0.0); },          // x0 / 0
      [](NlWriter& nl) { nl.operation(5).variable(0).constant(-2.0); },         // 0^-2
      [](NlWriter& nl) { nl.operation(53).operation(45).variable(0).line(); },  // acos(cosh 0), no derivative
  };
  for (const auto& body : bodies) {
    const auto nl = parse_nonlinear_nl(of_one_row(body), "test");
    if (nl) {
      EXPECT_FALSE(everything_at(nl->problem, nl->problem.start).empty());
    } else {
      EXPECT_NE(nl.error().message().find("in constraint C0"), std::string::npos) << nl.error().message();
    }
  }
}

// Whatever a file says: it is refused with a reason, or its functions can be asked.
TEST(NlFunctions, EveryBeginningAndSixHundredChangedFilesAreTakenOrRefusedAndNothingElse) {
  std::mt19937 random(20);
  int taken = 0, refused = 0;
  const auto look_at = [&](const std::string& content) {
    const auto nl = parse_nonlinear_nl(content, "test");
    if (!nl) {
      ++refused;
      EXPECT_FALSE(nl.error().message().empty());
      return;
    }
    ++taken;
    EXPECT_GT(everything_at(nl->problem, nl->problem.start).size(), 4U);
  };
  for (const bool binary : {false, true}) {
    const std::string whole = bent(binary);
    for (std::size_t length = 0; length < whole.size(); ++length) look_at(whole.substr(0, length));
    for (int i = 0; i < 300; ++i) {
      std::string content = whole;
      for (int changes = 1 + i % 3; changes > 0; --changes) {
        char& byte = content[random() % content.size()];
        byte = binary ? static_cast<char>(random()) : "0123456789onvCJ-. \n"[random() % 19];
      }
      look_at(content);
    }
  }
  EXPECT_GT(taken, 50);
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace marble::formats
