// Nonlinear .nl files that begin near a pole, or at it: read, and solved.
#include <gtest/gtest.h>

#include <functional>
#include <sstream>

#include "nl/nl_nonlinear.h"
#include "nl_writer.h"
#include "pole_problems.h"

namespace marble::testing {
namespace {

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
