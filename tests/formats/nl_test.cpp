#include <gtest/gtest.h>

#include <functional>
#include <sstream>

#include "marble/solver.h"
#include "nl/nl_nonlinear.h"
#include "nl/nl_problem.h"
#include "nl_writer.h"
#include "pole_problems.h"

namespace marble::formats {
namespace {

// AMPL's .nl files: what is an LCQP is read as it is meant, everything else is refused with its reason.
using testing::NlWriter;

/// min (x0 - 1)^2 + x1^2  s.t.  0 <= x1 complements x1 - x0 >= 0: the best is 0.5 at (0.5, 0.5).
std::string corner(bool binary) {
  NlWriter nl(binary, 2, 1, 1);
  nl.key('C').integer(0).constant(0.0);
  nl.key('O').integer(0).integer(0).operation(0);
  nl.operation(5).operation(1).variable(0).constant(1.0).constant(2.0);
  nl.operation(2).variable(1).variable(1);
  nl.key('x').integer(2).entry(0, 0.25).entry(1, 0.75);
  nl.key('r').complements(1, 1);
  nl.key('b').free().at_least(0.0);
  nl.key('k').integer(1).line().integer(1);
  nl.key('J').integer(0).integer(2).entry(0, -1.0).entry(1, 1.0);
  nl.key('G').integer(0).integer(2).entry(0, 0.0).entry(1, 0.0);
  return nl.content();
}

TEST(Nl, TextAndBinaryAreTheSameProblem) {
  for (const bool binary : {false, true}) {
    const auto file = parse_nl(corner(binary), "corner");
    ASSERT_TRUE(file.has_value()) << file.error().message() << '\n' << corner(binary);
    const OwnedProblem& problem = file->problem;
    EXPECT_EQ(problem.g, (std::vector<double>{-2.0, 0.0}));
    EXPECT_EQ(problem.c0, 1.0);
    EXPECT_EQ(problem.Q.values, (std::vector<double>{2.0, 2.0}));
    EXPECT_EQ(problem.l.size(), 1U);
    EXPECT_EQ(problem.d.size(), 0U) << "the bound is the pair's";
    EXPECT_EQ(problem.initial_z, (std::vector<double>{0.25, 0.75}));
    const Solution solution = solve_in_process(problem.view()).value();
    EXPECT_EQ(solution.status, Status::solved);
    EXPECT_NEAR(solution.objective, 0.5, 1e-9);
  }
}

/// As AMPL writes it: every kind of bound, a maximum, a defined variable, a sum, a quotient, short constants.
std::string everything(bool binary) {
  NlWriter nl(binary, 4, 4, 1);
  nl.key('V').integer(4).integer(1).integer(0).entry(2, 3.0);  // v4 = 3 x2 + (x0 - 2)
  nl.operation(1).variable(0).constant(2.0);
  nl.key('C').integer(0).constant(0.0);
  nl.key('C').integer(1).constant(5.0);
  nl.key('C').integer(2).variable(4);
  nl.key('C').integer(3).operation(16).variable(3);
  nl.key('O').integer(0).integer(1);  // maximize -(x0 x1) / 2 - x3^2 + 7 + x2
  nl.operation(54).integer(3);
  nl.operation(3).operation(16).operation(2).variable(0).variable(1).constant(2.0);
  nl.operation(16).operation(77).variable(3);
  nl.constant(7.0);
  nl.key('r').between(-1.0, 2.0).equal(6.0).at_most(9.0).complements(3, 1);
  nl.key('b').free().between(-1.0, 1.0).at_least(-3.0).equal(4.0);
  nl.key('J').integer(0).integer(1).entry(0, 2.0);
  nl.key('J').integer(1).integer(1).entry(1, 1.5);
  nl.key('G').integer(0).integer(1).entry(2, 1.0);
  return nl.content();
}

// min (x0 - 1)^2 + (x1 - 2)^2  s.t.  0 <= x0 complements x1 >= 0, -1 <= x0 + x1 <= 3: the best is 1 at (0,
// 2). As the writers of two front ends put it, which were not at hand: by what is published of them.
struct Written {
  const char* by;
  const char* content;
};
constexpr Written kWritten[] = {
    // MathOptInterface, FileFormats.NL, of MOI.Complements: no comments; quadratic terms as products, their
    // constant
    // before them, the linear rest in G; every variable has its start; the last column is not counted.
    {"JuMP's AmplNLWriter",
     "g3 1 1 0\n 2 2 1 1 0 0\n 0 1\n 0 0\n 0 2 0\n 0 0 0 1\n 0 0 0 0 0\n 3 2\n 0 0\n 0 0 0 0 0\n"
     "C0\nn0\nC1\nn0\n"
     "O0 0\no0\nn5\no0\no2\nv0\nv0\no2\nv1\nv1\n"
     "x2\n0 0.25\n1 0\n"
     "r\n5 1 1\n0 -1 3\n"
     "b\n2 0\n3\n"
     "k1\n1\nJ0 1\n1 1\nJ1 2\n0 1\n1 1\nG0 2\n0 -2\n1 -4\n"},
    // AMPL ("Writing .nl Files", Gay 2005): options in the first line, comments behind tabs, suffixes (here a
    // basis)
    // before all else, powers as o5, a start of what is not zero, a dual start.
    {"AMPL",
     "g3 1 1 0\t# problem corner\n 2 2 1 1 0\t# vars, constraints, objectives, ranges, eqns\n"
     " 0 1 1 0 0 0\t# nonlinear constrs, objs; ccons: lin, nonlin, nd, nzlb\n 0 0\t# network\n"
     " 0 2 0\t# nonlinear vars in constraints, objectives, both\n 0 0 0 1\t# linear network variables; "
     "functions; "
     "arith, flags\n 0 0 0 0 0\t# discrete variables\n 3 2\t# nonzeros in Jacobian, obj. gradient\n"
     " 7 2\t# max name lengths: constraints, variables\n 0 0 0 0 0\t# common exprs\n"
     "S0 2 sstatus\n0 3\n1 1\nS1 1 sstatus\n1 1\n"
     "C0\t#contact\nn0\nC1\t#band\nn0\n"
     "O0 0\t#cost\no0\t# + \no5\t#^\no1\t# - \nv0\t#gap\nn1\nn2\no5\t#^\no1\t# - \nv1\t#force\nn2\nn2\n"
     "d1\t# initial dual guess\n1 0.5\n"
     "x1\t# initial guess\n0 0.25\t#gap\n"
     "r\t#2 ranges (rhs's)\n5 1 1\t#contact\n0 -1 3\t#band\n"
     "b\t#2 bounds (on variables)\n2 0\t#gap\n3\t#force\n"
     "k1\t#intermediate Jacobian column lengths\n1\nJ0 1\n1 1\nJ1 2\n0 1\n1 1\nG0 2\n0 0\n1 0\n"}};

TEST(Nl, FilesInTheFormOfOtherWritersAreTheProblemTheyMean) {
  for (const Written& written : kWritten) {
    const auto nl = parse_nl_problem(written.content, "corner", {});
    ASSERT_TRUE(nl.has_value()) << written.by << ": " << nl.error().message();
    const OwnedProblem& problem = nl->file.problem;
    EXPECT_EQ(problem.initial_z, (std::vector<double>{0.25, 0.0})) << written.by;
    EXPECT_EQ(problem.l.size(), 1U) << written.by;
    EXPECT_EQ(problem.d.size(), 2U) << written.by << ": a range is two rows";
    const Solution solution = solve_in_process(problem.view()).value();
    EXPECT_EQ(solution.status, Status::solved) << written.by;
    EXPECT_NEAR(solution.objective, 1.0, 1e-9) << written.by;
    EXPECT_NEAR(solution.z[0], 0.0, 1e-9) << written.by;
    EXPECT_NEAR(solution.z[1], 2.0, 1e-9) << written.by;
  }
}

TEST(Nl, EveryKindOfRowAndTermIsReadAsItIsMeant) {
  for (const bool binary : {false, true}) {
    const auto file = parse_nl(everything(binary), "everything");
    ASSERT_TRUE(file.has_value()) << file.error().message();
    const OwnedProblem& p = file->problem;
    EXPECT_EQ(p.g, (std::vector<double>{0.0, 0.0, -1.0, 0.0, 0.0, 0.0})) << "the negative of a maximum";
    EXPECT_EQ(p.c0, -7.0);
    // Q of x0 x1 / 2 + x3^2.
    EXPECT_EQ(p.Q.row_indices, (std::vector<Index>{1, 0, 3}));
    EXPECT_EQ(p.Q.values, (std::vector<double>{0.5, 0.5, 2.0}));
    // 1.5 x1 + 5 = 6; the parts of the mixed row: -x3 = p - q; x3 = 4.
    EXPECT_EQ(p.b, (std::vector<double>{-1.0, 0.0, -4.0}));
    // -1 <= 2 x0 <= 2; 3 x2 + x0 - 2 <= 9; x2 >= -3.
    EXPECT_EQ(p.d, (std::vector<double>{1.0, 2.0, 11.0, 3.0}));
    EXPECT_EQ(p.C.values, (std::vector<double>{2.0, -2.0, -1.0, -3.0, 1.0}));
    // p complements x1 + 1, q complements 1 - x1.
    EXPECT_EQ(p.l, (std::vector<double>{0.0, 0.0}));
    EXPECT_EQ(p.r, (std::vector<double>{1.0, 1.0}));
    EXPECT_EQ(p.R.values, (std::vector<double>{1.0, -1.0}));
  }
}

TEST(Nl, ALimitOf1e20IsNone) {
  for (const double none : {1e20, 1e30}) {
    NlWriter file(false, 1, 1, 1);
    file.key('C').integer(0).constant(0.0);
    file.key('O').integer(0).integer(0).constant(0.0);
    file.key('r').between(-none, 2.0);
    file.key('b').between(0.0, none);
    file.key('J').integer(0).integer(1).entry(0, 1.0);
    file.key('G').integer(0).integer(1).entry(0, 1.0);
    const auto read = parse_nl(file.content(), "limits");
    ASSERT_TRUE(read.has_value()) << read.error().message();
    EXPECT_EQ(read->problem.d, (std::vector<double>{2.0, 0.0})) << none;
  }
}

TEST(Nl, WhatIsNoLcqpIsRefusedWithItsReason) {
  const auto refusal = [](NlWriter& nl) {
    const auto file = parse_nl(nl.content(), "no");
    return file ? std::string("taken") : file.error().message();
  };
  NlWriter integers(false, 2, 0, 1, 2);
  EXPECT_NE(refusal(integers).find("2 integer variables"), std::string::npos);
  NlWriter objectives(false, 2, 0, 2);
  EXPECT_NE(refusal(objectives).find("2 objectives"), std::string::npos);
  NlWriter cubic(false, 2, 0, 1);
  cubic.key('O').integer(0).integer(0).operation(2).variable(0).operation(2).variable(0).variable(1);
  EXPECT_NE(refusal(cubic).find("quadratic at most in line 1"), std::string::npos);
  NlWriter quadratic_row(false, 2, 1, 1);
  quadratic_row.key('C').integer(0).operation(2).variable(0).variable(1);
  EXPECT_NE(refusal(quadratic_row).find("C0"), std::string::npos);
  NlWriter sine(false, 2, 0, 1);
  sine.key('O').integer(0).integer(0).operation(41).variable(0);
  EXPECT_NE(refusal(sine).find("o41"), std::string::npos);
  NlWriter cube(false, 2, 0, 1);
  cube.key('O').integer(0).integer(0).operation(5).variable(0).constant(3.0);
  EXPECT_NE(refusal(cube).find("exponent"), std::string::npos);
  NlWriter outside(false, 2, 1, 1);
  outside.key('J').integer(1).integer(0);
  EXPECT_NE(refusal(outside).find("J = 1: must be in [0, 0]"), std::string::npos) << refusal(outside);
  NlWriter nobody(false, 2, 0, 1);
  nobody.key('J').integer(0).integer(1).entry(0, 1.0);
  EXPECT_NE(refusal(nobody).find("J"), std::string::npos);
  EXPECT_FALSE(parse_nl("", "empty").has_value());
  EXPECT_FALSE(parse_nl("{}", "json").has_value());
}

// A problem that the solver would take, or a reason.
bool expect_sound(std::string_view content) {
  const auto file = parse_nl(content, "spoilt");
  if (!file) {
    EXPECT_EQ(file.error().code, ErrorCode::invalid_argument);
    EXPECT_FALSE(file.error().message().empty());
    return false;
  }
  const auto problem = Problem::create(file->problem.view());
  EXPECT_TRUE(problem.has_value()) << problem.error().message();
  return true;
}

TEST(Nl, EveryBeginningOfAFileAndEveryChangedByteIsTakenOrRefusedAndNothingElse) {
  for (const bool binary : {false, true}) {
    const std::string whole = everything(binary);
    ASSERT_TRUE(expect_sound(whole));
    int taken = 0;
    int refused = 0;
    for (std::size_t length = 0; length < whole.size(); ++length) {
      const bool sound = expect_sound(std::string_view(whole).substr(0, length));
      EXPECT_FALSE(sound && length + 1 < whole.size())
          << "a part is no problem: " << length;  // but a line's end
    }
    for (std::size_t at = 0; at < whole.size(); ++at) {
      for (const char c : {'\0', '9', '-', 'J', '\xff'}) {
        std::string changed = whole;
        changed[at] = c;
        ++(expect_sound(changed) ? taken : refused);
      }
    }
    EXPECT_GT(taken, 0) << "other numbers are another problem";
    EXPECT_GT(refused, static_cast<int>(whole.size())) << "most bytes mean something";
  }
}

TEST(Nl, AFileThatEndsAfterASegmentNamesTheFirstThatIsMissing) {
  const std::string whole = corner(false);
  const auto refusal = [&](const char* cut) {
    const auto file = parse_nl(std::string_view(whole).substr(0, whole.find(cut) + 1), "cut");
    return file ? std::string("taken") : file.error().message();
  };
  for (const auto& [cut, reason] : {std::pair{"\nC0", "O = 0 of 1: is missing: the file ends too soon"},
                                    {"\nO0", "O = 0 of 1: is missing"},
                                    {"\nr\n", "r = 0 of 1: is missing"},
                                    {"\nb\n", "b = 0 of 2: is missing"},
                                    {"\nJ0", "J = 0 of 2: is missing"},
                                    {"\nG0", "G = 0 of 2: is missing"}}) {
    EXPECT_NE(refusal(cut).find(reason), std::string::npos) << refusal(cut) << '\n' << whole;
  }
}

TEST(Nl, ExpressionsNestedBeyondReasonAreRefusedNotFollowed) {
  NlWriter nl(false, 1, 0, 1);
  nl.key('O').integer(0).integer(0);
  for (int i = 0; i < 100'000; ++i) nl.operation(16);
  nl.variable(0);
  const auto file = parse_nl(nl.content(), "deep");
  ASSERT_FALSE(file.has_value());
  EXPECT_NE(file.error().message().find("must be nested at most "), std::string::npos)
      << file.error().message();
}

}  // namespace
}  // namespace marble::formats

namespace marble::testing {
namespace {

// Nonlinear .nl files that begin near a pole, or at it: read, and solved.

/// An expression that can be written: what pole_problems.h wants of a scalar.
class Expression {
 public:
  Expression(double value = 0.0) : write_([value](NlWriter& nl) { nl.constant(value); }) {}
  static Expression variable(int index) {
    return Expression([index](NlWriter& nl) { nl.variable(index); });
  }
  void write(NlWriter& nl) const { write_(nl); }

  friend Expression operator+(const Expression& a, const Expression& b) { return binary(0, a, b); }
  friend Expression operator-(const Expression& a, const Expression& b) { return binary(1, a, b); }
  friend Expression operator*(const Expression& a, const Expression& b) { return binary(2, a, b); }
  friend Expression operator/(const Expression& a, const Expression& b) { return binary(3, a, b); }
  friend Expression operator-(const Expression& a) { return unary(16, a); }
  friend Expression pow(const Expression& a, double power) { return binary(5, a, power); }
  friend Expression log(const Expression& a) { return unary(43, a); }
  friend Expression exp(const Expression& a) { return unary(44, a); }

 private:
  explicit Expression(std::function<void(NlWriter&)> write) : write_(std::move(write)) {}
  static Expression unary(int code, const Expression& a) {
    return Expression([code, a](NlWriter& nl) { a.write(nl.operation(code)); });
  }
  static Expression binary(int code, const Expression& a, const Expression& b) {
    return Expression([code, a, b](NlWriter& nl) {
      a.write(nl.operation(code));
      b.write(nl);
    });
  }

  std::function<void(NlWriter&)> write_;
};

using Problem = PoleProblem<Expression>;

std::string file_of(const Problem& problem, double distance) {
  const auto n = static_cast<int>(problem.lower.size());
  std::vector<Expression> x;
  for (int j = 0; j < n; ++j) x.push_back(Expression::variable(j));
  const PoleParts<Expression> parts = problem.parts(x);
  std::vector<Expression> rows = parts.equalities;
  rows.insert(rows.end(), parts.inequalities.begin(), parts.inequalities.end());
  rows.insert(rows.end(), parts.G.begin(), parts.G.end());
  NlWriter nl(false, n, static_cast<int>(rows.size()), 1);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].write(nl.key('C').integer(static_cast<int>(i)));
  parts.objective.write(nl.key('O').integer(0).integer(0));
  const std::vector<double> start = problem.start(distance);
  nl.key('x').integer(n);
  for (int j = 0; j < n; ++j) nl.entry(j, start[static_cast<std::size_t>(j)]);
  nl.key('r');
  for (std::size_t i = 0; i < parts.equalities.size(); ++i) nl.equal(0.0);
  for (std::size_t i = 0; i < parts.inequalities.size(); ++i) nl.at_least(0.0);
  for (std::size_t i = 0; i < parts.G.size(); ++i) nl.complements(1, problem.complement);
  nl.key('b');
  for (std::size_t j = 0; j < problem.lower.size(); ++j) nl.between(problem.lower[j], problem.upper[j]);
  const auto all_variables = [&] {
    nl.integer(n);
    for (int j = 0; j < n; ++j) nl.entry(j, 0.0);
  };
  for (std::size_t i = 0; i < rows.size(); ++i) nl.key('J').integer(static_cast<int>(i)), all_variables();
  nl.key('G').integer(0), all_variables();
  return nl.content();
}

void expect_solution(const Problem& problem, double distance) {
  std::ostringstream text;
  text << problem.name << " from " << distance;
  const std::string what = text.str();
  const auto nl = formats::parse_nonlinear_nl(file_of(problem, distance), "test");
  ASSERT_TRUE(nl.has_value()) << what << ": " << nl.error().message();
  EXPECT_TRUE(nl->problem.hessian) << what << ": second derivatives near a pole are those of the library";
  const auto answer = nonlinear::solve(nl->problem, nonlinear::open_ticks_in_process);
  ASSERT_TRUE(answer.has_value()) << what << ": " << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved) << what << ": " << answer->detail;
  EXPECT_LE(answer->ticks, problem.most_lcqps) << what;
  for (std::size_t j = 0; j < problem.solution.size(); ++j)
    EXPECT_NEAR(answer->x[j], problem.solution[j], 1e-6) << what;
}

TEST(NlPoles, AreLeftWithin50Lcqps) {
  for (const Problem& problem : pole_problems<Expression>())
    for (const double distance : kPoleDistances) expect_solution(problem, distance);
}

TEST(NlPoles, AStartAtThePoleIsMovedOffItAndSolved) {
  for (const Problem& problem : pole_problems<Expression>()) expect_solution(problem, 0.0);
}

/// min x0 s.t. x1 >= 2, both as whole expressions.
TEST(NlPoles, AVariableThatIsAWholeExpressionHasItsSlope) {
  NlWriter nl(false, 2, 1, 1);
  nl.key('C').integer(0).variable(1);
  nl.key('O').integer(0).integer(0).variable(0);
  nl.key('r').at_least(2.0).key('b').free().free();
  nl.key('J').integer(0).integer(1).entry(1, 0.0);
  nl.key('G').integer(0).integer(1).entry(0, 0.0);
  const auto file = formats::parse_nonlinear_nl(nl.content(), "test");
  ASSERT_TRUE(file.has_value()) << file.error().message();
  const std::vector<double> x{0.25, 3.0};
  EXPECT_TRUE(nonlinear::check_derivatives(file->problem, x).has_value());
  EXPECT_EQ(file->problem.derivatives(x).gradient[0], 1.0);
}

}  // namespace
}  // namespace marble::testing
