#include "research/full_jacobian.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "dense_system.h"
#include "marble/examples.h"
#include "marble/research/conditioning.h"
#include "random_setting.h"

namespace marble {
namespace {

using testing::all_shapes;
using testing::Setting;

double norm_1(const Eigen::MatrixXd& m) { return m.cwiseAbs().colwise().sum().maxCoeff(); }

TEST(FullJacobian, IsTheDerivativeOfTheResidualAndItsConditionIsEstimatedFromBelow) {
  for (const auto& sizes : all_shapes()) {
    for (const Retraction retraction : {Retraction::softplus, Retraction::exponential}) {
      Setting s(sizes, 3);
      s.sub.retraction = retraction;
      const Eigen::SparseMatrix<double> sparse = full_jacobian(s.problem, s.sub, s.x, 0.5);
      const Eigen::MatrixXd dense = testing::full_jacobian(s.problem, s.sub, s.x, 0.5);
      EXPECT_LT((Eigen::MatrixXd(sparse) - dense).cwiseAbs().maxCoeff(), 1e-12);
      const double condition = norm_1(dense) * norm_1(dense.inverse());
      EXPECT_LE(condition_estimate(sparse), condition * (1.0 + 1e-9));
      EXPECT_GE(condition_estimate(sparse), condition / 3.0);
    }
  }
}

TEST(FullJacobian, ASingularOneHasNoCondition) {
  Eigen::SparseMatrix<double> singular(2, 2);
  singular.insert(0, 0) = 1.0;
  EXPECT_EQ(condition_estimate(singular), std::numeric_limits<double>::infinity());
}

TEST(PathConditions, AreThoseOfEveryKappaOfThePathAndEndAsItDoes) {
  const OwnedProblem p = examples::qpec({}, 1);
  for (const Retraction retraction : {Retraction::softplus, Retraction::exponential}) {
    const Options options{.path = Path::paper, .polish = false, .retraction = retraction};
    const PathConditions path = path_conditions(Problem::create(p.view()).value(), options).value();
    const Solution s = solve_in_process(p.view(), options).value();
    EXPECT_EQ(path.status, s.status) << path.detail;
    EXPECT_EQ(path.iterations, s.iterations);
    ASSERT_GE(path.at.size(), 5U);
    for (std::size_t k = 0; k < path.at.size(); ++k) {
      EXPECT_GE(path.at[k].condition, 1.0);
      const bool end = k + 1 == path.at.size();
      EXPECT_LE(path.at[k].kappa, (end ? 1.0 : 0.7) * (k == 0 ? 0.1 : path.at[k - 1].kappa));
    }
  }
}

TEST(PathConditions, SaysWhatIsWrong) {
  const OwnedProblem p = examples::qpec({}, 1);
  const Problem problem = Problem::create(p.view()).value();
  EXPECT_EQ(path_conditions(problem, {.rho_max = -1.0}).error().field, "rho_max");
  std::stop_source stop;
  stop.request_stop();
  const auto stopped = path_conditions(problem, {}, {.stop = stop.get_token()});
  EXPECT_TRUE(stopped ? stopped->status == Status::cancelled : stopped.error().code == ErrorCode::cancelled);
}

}  // namespace
}  // namespace marble
