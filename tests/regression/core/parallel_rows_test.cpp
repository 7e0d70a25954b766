// A convex QP with two equalities of condition number 4e4 ended as locally_infeasible, and others with rows
// within 1e-4 to 1e-7 of parallel as almost_solved or solved with z off by 0.1 to 2.
//
// All engines hold rows at zero by a penalty of at most 1e8, and rows within e of parallel need multipliers
// of 1/e². Where these engines fail, or have not converged while rows are nearly parallel, small problems are
// now solved by dense orthogonal factors. What is still not solved names the rows.
#include "search/parallel_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "marble/solver.h"
#include "support/dense_matrix.h"

namespace marble {
namespace {

using testing::sparse;

Eigen::MatrixXd random_matrix(std::mt19937_64& engine, Eigen::Index rows, Eigen::Index columns) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(engine); });
}

std::vector<double> values(const Eigen::VectorXd& x) { return {x.data(), x.data() + x.size()}; }

double distance(const Solution& solution, const Eigen::VectorXd& z) {
  const Eigen::Map<const Eigen::VectorXd> found(solution.z.data(), z.size());
  return (found - z).lpNorm<Eigen::Infinity>() / (1.0 + z.lpNorm<Eigen::Infinity>());
}

Solution solve(const OwnedProblem& p) {
  const auto problem = Problem::create(p.view());
  return Solver::create(problem.value()).value().solve().value();
}

TEST(ParallelRows, TwoEqualitiesOfTheReportAreSolved) {
  OwnedProblem p;
  p.Q = sparse(Eigen::Matrix2d::Identity());
  p.g = {0.0, 0.0};
  p.A = sparse(Eigen::Matrix2d{{1.0, -1.0}, {-1.0, 1.0001}});
  p.b = {-0.00981, 0.0};
  const Solution solution = solve(p);
  EXPECT_EQ(solution.status, Status::solved) << solution.detail;
  EXPECT_NEAR(solution.z[0], 98.10981, 1e-8);
  EXPECT_NEAR(solution.z[1], 98.1, 1e-8);
}

enum class Kind { equalities, inequalities, one_of_each, pairs };

// Optimal at a random z, by multipliers of 1/e of the two nearly parallel rows.
struct Known {
  OwnedProblem problem;
  Eigen::VectorXd z;
};

Known with_parallel_rows(Kind kind, double e, Eigen::Index n, Eigen::Index m, bool box, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  Known known;
  known.z = random_matrix(engine, n, 1);
  Eigen::MatrixXd rows = random_matrix(engine, m, n);
  rows.row(1) = e * rows.row(1) + (kind == Kind::equalities ? 1.0 : -1.0) * rows.row(0);
  Eigen::VectorXd multipliers = random_matrix(engine, m, 1).cwiseAbs();
  multipliers.head(2).array() += 1.0 / e;
  if (kind == Kind::equalities) multipliers[1] = -multipliers[1];
  const Eigen::VectorXd offsets = -rows * known.z;
  OwnedProblem& p = known.problem;
  p.Q = sparse(Eigen::MatrixXd::Identity(n, n));
  p.g = values(rows.transpose() * multipliers - known.z);
  Eigen::MatrixXd C(0, n);
  Eigen::VectorXd d(0);
  if (kind == Kind::equalities) {
    p.A = sparse(rows), p.b = values(offsets);
  } else if (kind == Kind::pairs) {
    const Eigen::MatrixXd others = random_matrix(engine, m, n);
    p.L = sparse(rows), p.l = values(offsets);
    p.R = sparse(others), p.r = values(Eigen::VectorXd::Ones(m) - others * known.z);
  } else {
    const Eigen::Index equalities = kind == Kind::one_of_each ? 1 : 0;
    if (equalities > 0) p.A = sparse(rows.topRows(1)), p.b = values(offsets.head(1));
    C = rows.bottomRows(m - equalities);
    d = offsets.tail(m - equalities);
  }
  if (box) {
    const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(n, n);
    C = (Eigen::MatrixXd(C.rows() + 2 * n, n) << C, identity, -identity).finished();
    d = (Eigen::VectorXd(d.size() + 2 * n) << d, Eigen::VectorXd::Constant(2 * n, 10.0)).finished();
  }
  if (d.size() > 0) p.C = sparse(C), p.d = values(d);
  return known;
}

TEST(ParallelRows, AreSolvedWhereTheyAreEqualitiesInequalitiesOneOfEachOrPairs) {
  for (const Kind kind : {Kind::equalities, Kind::inequalities, Kind::one_of_each, Kind::pairs}) {
    for (const double e : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7}) {
      for (const auto& [n, m] : {std::pair{2, 2}, {3, 2}, {6, 3}, {20, 10}, {50, 40}}) {
        for (const bool box : {false, true}) {
          const Known known = with_parallel_rows(kind, e, n, m, box, 7U * static_cast<unsigned>(n) + box);
          const Solution solution = solve(known.problem);
          const std::string where = std::to_string(static_cast<int>(kind)) + " " + std::to_string(e) + " " +
                                    std::to_string(n) + (box ? " box: " : ": ") + solution.detail;
          EXPECT_EQ(solution.status, Status::solved) << where;
          const bool is_local = kind == Kind::pairs && m > 24;  // perhaps another branch's solution
          EXPECT_TRUE(is_local || distance(solution, known.z) <= 1e-6) << where;
        }
      }
    }
  }
}

TEST(ParallelRows, ProblemsTooLargeForDenseFactorsNameTheRows) {
  std::mt19937_64 engine(1);
  const Eigen::Index n = 240;
  Eigen::MatrixXd rows = random_matrix(engine, 6, n);
  rows.row(4) = -2.0 * rows.row(1) + 1e-6 * rows.row(4);
  OwnedProblem p;
  p.Q = sparse(Eigen::MatrixXd::Identity(n, n));
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  p.A = sparse(rows);
  p.b = values(random_matrix(engine, 6, 1));
  const Solution solution = solve(p);
  if (is_solved(solution.status) && solution.status != Status::almost_solved) return;
  EXPECT_NE(solution.status, Status::infeasible);
  EXPECT_THAT(solution.detail,
              ::testing::HasSubstr("ill-conditioned rows A[1] and A[4]: parallel to within"));
}

TEST(ParallelRows, ExactMultiplesAreNotNamed) {
  OwnedProblem p;
  p.g = {1.0, 1.0, 1.0};
  p.C = sparse(Eigen::MatrixXd{{1.0, 2.0, 3.0}, {-2.0, -4.0, -6.0}, {0.0, 1.0, 0.0}, {1.0, 2.0, 3.00003}});
  p.d = {0.0, 0.0, 0.0, 0.0};
  const ScaledProblem scaled = scale(Problem::create(p.view()).value(), 0);
  const auto parallel = nearly_parallel_rows(scaled);
  ASSERT_TRUE(parallel);
  EXPECT_EQ(parallel->second, 3);
  EXPECT_NEAR(parallel->sine, 5e-6, 5e-6);
  p.C = sparse(Eigen::MatrixXd{{1.0, 2.0, 3.0}, {-2.0, -4.0, -6.0}, {0.0, 1.0, 0.0}, {0.1, 0.2, 0.3}});
  EXPECT_FALSE(nearly_parallel_rows(scale(Problem::create(p.view()).value(), 0)));
}

}  // namespace
}  // namespace marble
