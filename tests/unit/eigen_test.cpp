// Eigen's matrices and vectors go in and come out without copies.
#include "marble/eigen.h"

#include <gtest/gtest.h>

#include <utility>

#include "marble/solver.h"

namespace marble {
namespace {

// min x² − 6x + y² − 4y  s.t.  0 ≤ x ⊥ y ≥ 0, x + z = 1.5: the best is (3, 0, −1.5).
struct Model {
  Model() {
    Q.insert(0, 0) = 2.0;
    Q.insert(1, 1) = 2.0;
    A.insert(0, 0) = 1.0;
    A.insert(0, 2) = 1.0;
    L.insert(0, 0) = 1.0;
    R.insert(0, 1) = 1.0;
    for (EigenSparse* matrix : {&Q, &A, &L, &R}) matrix->makeCompressed();
  }
  [[nodiscard]] ProblemView problem() const {
    ProblemView problem;
    problem.Q = view(Q);
    problem.g = view(g);
    problem.A = view(A), problem.b = view(b);
    problem.L = view(L), problem.l = view(zero);
    problem.R = view(R), problem.r = view(zero);
    return problem;
  }
  EigenSparse Q{3, 3}, A{1, 3}, L{1, 3}, R{1, 3};
  Eigen::VectorXd g = Eigen::Vector3d(-6.0, -4.0, 0.0);
  Eigen::VectorXd b = Eigen::VectorXd::Constant(1, -1.5), zero = Eigen::VectorXd::Zero(1);
};

TEST(EigenViews, BorrowTheArraysOfMatricesAndVectors) {
  const Model model;
  const ProblemView view = model.problem();
  EXPECT_EQ(view.Q.values.data(), model.Q.valuePtr());
  EXPECT_EQ(view.A.row_indices.data(), model.A.innerIndexPtr());
  EXPECT_EQ(view.L.column_pointers.data(), model.L.outerIndexPtr());
  EXPECT_EQ(view.g.data(), model.g.data());
  EXPECT_EQ(view.g.size(), 3u);
}

TEST(EigenViews, MakeAProblemThatIsSolvedAndUpdated) {
  const Model model;
  const auto problem = Problem::create(model.problem());
  ASSERT_TRUE(problem.has_value()) << problem.error().message();
  Solver solver = Solver::create(*problem).value();
  const Solution first = solver.solve().value();
  EXPECT_TRUE(map(first.z).isApprox(Eigen::Vector3d(3.0, 0.0, -1.5), 1e-6)) << map(first.z);
  const Eigen::Vector4d state(1.0, 2.0, -5.0, 4.0);
  const Eigen::Map<const Eigen::VectorXd> mapped(state.data(), 4);
  ASSERT_TRUE(solver.update({.b = view(mapped.segment(2, 1))}).has_value());
  const Solution second = solver.solve().value();
  EXPECT_NEAR(map(second.z)(2), 2.0, 1e-6);
}

TEST(EigenViews, RefuseAMatrixThatIsNotCompressed) {
  Model model;
  model.A.uncompress();
  const auto problem = Problem::create(model.problem());
  ASSERT_FALSE(problem.has_value());
  EXPECT_EQ(problem.error().field, "A.column_pointers");
}

using Sum = decltype(std::declval<Eigen::VectorXd>() + std::declval<Eigen::VectorXd>());
static_assert(EigenVector<Eigen::VectorXd> && EigenVector<Eigen::Map<const Eigen::VectorXd>>);
static_assert(!EigenVector<Sum>, "an expression lies nowhere");
static_assert(!EigenVector<Eigen::VectorXf>);

}  // namespace
}  // namespace marble
