// The published claim: all 39 problems of MacMPEC are solved to their global optimum.
#include "marble/macmpec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/problem_builder.h"

namespace marble::examples {
namespace {

// The optima are known to 12 digits, and those of the portfolios are of size 10⁻⁵.
double slack(double optimum) { return optimum == 0.0 ? 1e-9 : 1e-7 * std::abs(optimum); }

double entry(const SparseMatrix& matrix, Index row, Index column) {
  for (Index k = matrix.column_pointers[static_cast<std::size_t>(column)];
       k < matrix.column_pointers[static_cast<std::size_t>(column) + 1]; ++k) {
    if (matrix.row_indices[static_cast<std::size_t>(k)] == row)
      return matrix.values[static_cast<std::size_t>(k)];
  }
  return 0.0;
}

TEST(Macmpec, Has39ProblemsByName) {
  ASSERT_EQ(macmpec().size(), 39U);
  EXPECT_TRUE(std::ranges::is_sorted(macmpec(), std::ranges::less_equal{}, &MacmpecProblem::name));
  for (const MacmpecProblem& each : macmpec()) {
    EXPECT_EQ(find_macmpec(each.name), &each) << each.name;
    EXPECT_FALSE(each.source.empty()) << each.name;
    const OwnedProblem problem = each.problem();
    EXPECT_EQ(problem.name, each.name);
    const auto valid = Problem::create(problem.view());
    EXPECT_TRUE(valid.has_value()) << each.name << ": " << valid.error().message();
    EXPECT_TRUE(problem.initial_z.empty() || problem.initial_z.size() == problem.g.size()) << each.name;
    EXPECT_FALSE(problem.l.empty()) << each.name;
  }
  EXPECT_EQ(find_macmpec("bard3"), nullptr);
  EXPECT_EQ(find_macmpec(""), nullptr);
}

TEST(Macmpec, AllAreSolvedToTheGlobalOptimum) {
  int global = 0;
  for (const MacmpecProblem& each : macmpec()) {
    const OwnedProblem problem = each.problem();
    const Solution s = solve_in_process(problem.view()).value();
    EXPECT_EQ(s.status, Status::solved) << each.name << ": " << s.detail;
    const testing::Verdict verdict = testing::judge(problem.view(), s);
    EXPECT_LE(verdict.infeasibility(), 1e-9) << each.name;
    EXPECT_NEAR(verdict.objective, each.optimum, slack(each.optimum)) << each.name;
    if (verdict.objective <= each.optimum + slack(each.optimum)) ++global;
  }
  EXPECT_EQ(global, 39);
}

TEST(Macmpec, EveryOptimumIsProvedByBranchAndBound) {
  Options options;
  options.global_search = true;
  for (const MacmpecProblem& each : macmpec()) {
    const Solution s = solve_in_process(each.problem().view(), options).value();
    EXPECT_TRUE(s.proved) << each.name << ": " << s.detail;
    EXPECT_NEAR(s.objective, each.optimum, slack(each.optimum)) << each.name;
    EXPECT_LE(s.bound, s.objective) << each.name;
  }
}

// flp4-1.dat and flp4-4.dat, as published: A is −C; N and M are the columns of R.
TEST(Macmpec, RandomProblemsHaveThePublishedNumbers) {
  const auto expect_near = [](double ours, double published) { EXPECT_NEAR(ours, published, 1e-13); };
  const OwnedProblem first = find_macmpec("flp4_1")->problem();
  expect_near(entry(first.C, 0, 0), 3.219666978048754);
  expect_near(entry(first.R, 0, 0), 2.930609467422402);
  expect_near(entry(first.R, 0, 50), 15.41352088258426);
  expect_near(first.d[0], 4.085855568605377);
  expect_near(first.r[29], 0.01843164271514632);
  const OwnedProblem last = find_macmpec("flp4_4")->problem();
  expect_near(entry(last.C, 0, 1), -0.3439678218261371);
  expect_near(entry(last.R, 2, 3), 1.511967333435102);
  expect_near(entry(last.R, 2, 102), 51.79384587715116);
  expect_near(last.d[4], 0.537573232319166);
}

// The target of the perturbed problem is the solution of the unperturbed one.
TEST(Macmpec, TargetsOfConvexRegressionSolveIt) {
  for (const char* name : {"liswet1_050", "liswet1_100", "liswet1_200"}) {
    const OwnedProblem problem = find_macmpec(name)->problem();
    const std::size_t n = problem.l.size();
    testing::ProblemBuilder::Row gradient;
    for (const double b : problem.b) gradient.push_back(b);  // min ½|x − y|², b = −y
    testing::ProblemBuilder forward(name, gradient);
    for (std::size_t i = 0; i < n + 2; ++i)
      forward.quadratic(static_cast<Index>(i), static_cast<Index>(i), 1.0);
    for (std::size_t j = 0; j < n; ++j) {
      testing::ProblemBuilder::Row row(n + 3, 0.0);
      row[j] = row[j + 2] = 1.0;
      row[j + 1] = -2.0;
      forward.at_least(row);
    }
    const Solution s = solve_in_process(forward.optimum(0.0).problem.view()).value();
    ASSERT_EQ(s.status, Status::solved) << name << ": " << s.detail;
    for (std::size_t i = 0; i < n + 2; ++i)
      EXPECT_NEAR(s.z[i], -problem.g[n + i] / 2.0, 1e-7) << name << " " << i;
  }
}

}  // namespace
}  // namespace marble::examples
