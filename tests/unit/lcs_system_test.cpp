// Checks of systems and of planning problems.
#include <gtest/gtest.h>

#include <limits>

#include "lcs_systems.h"

namespace marble {
namespace {

using testing::OwnedSystem;
using testing::random_system;
using testing::Values;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string message_of(const OwnedSystem& system) {
  const auto made = LCS::create(system.view());
  return made ? "" : made.error().message();
}

TEST(Lcs, HasPartsThatAreConstantOrOnePerStage) {
  OwnedSystem s = random_system(1, 3, 2, 2);
  const OwnedSystem varying = random_system(2, 3, 2, 2, 4);
  s.c = varying.c;
  const LCS lcs = LCS::create(s.view()).value();
  EXPECT_EQ(lcs.stages(), 4);
  for (Index k = 0; k < 4; ++k) {
    const auto a = lcs.part(LcsPart::A, k), c = lcs.part(LcsPart::c, k);
    EXPECT_EQ(Values(a.begin(), a.end()), s.A);
    EXPECT_EQ(Values(c.begin(), c.end()), Values(s.c.begin() + 2 * k, s.c.begin() + 2 * k + 2));
  }
}

TEST(Lcs, NamesStageIndexAndValueOfABadNumber) {
  OwnedSystem s = random_system(3, 3, 2, 2, 4);
  s.F[4 * 2 + 1] = kNan;
  EXPECT_EQ(message_of(s), "F[2][1] = nan: must be finite");
  s = random_system(3, 3, 2, 2);
  s.d[2] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(message_of(s), "d[2] = inf: must be finite");
}

TEST(Lcs, RefusesWrongSizes) {
  OwnedSystem s = random_system(4, 3, 2, 2);
  s.B.pop_back();
  EXPECT_EQ(message_of(s), "B = 5: must have 6 entries, or so many per stage");
  s = random_system(4, 3, 2, 2, 4);
  s.E.resize(3 * 6);
  EXPECT_EQ(message_of(s), "E = 3: stages; must have 4 stages, as many as the parts before it");
  s = random_system(4, 3, 2, 2);
  s.states = 0;
  EXPECT_EQ(LCS::create(s.view()).error().field, "states");
  s.states = std::numeric_limits<Index>::max();
  EXPECT_EQ(LCS::create(s.view()).error().field, "states");
  s.states = 3, s.pairs = 0;
  EXPECT_EQ(LCS::create(s.view()).error().field, "D");
}

class Task : public ::testing::Test {
 protected:
  [[nodiscard]] std::string refusal() const {
    const auto made = LcsPlanner::create(system.view(), task);
    return made ? "" : made.error().message();
  }
  OwnedSystem system = random_system(7, 3, 2, 2);
  LcsTask task = {.stages = 5,
                  .Q = testing::diagonal({1, 2, 3}),
                  .R = testing::diagonal({1, 1}),
                  .P = testing::diagonal({1, 1, 1})};
};

TEST_F(Task, IsAcceptedWithAllParts) {
  task.R_change = testing::diagonal({1, 1});
  task.x_ref = Values(6 * 3, 1.0), task.u_ref = Values(2, 0.5);
  task.x_lb = Values(3, -1e20), task.x_ub = Values(3, 4.0);
  task.u_lb = Values(2, -std::numeric_limits<double>::infinity()), task.u_ub = Values(2, 1.0);
  task.max_u_change = Values(2, 0.5);
  EXPECT_EQ(refusal(), "");
}

TEST_F(Task, RefusesStagesThatDoNotFit) {
  task.stages = 0;
  EXPECT_EQ(refusal(), "stages = 0: must be >= 1");
  task.stages = 5;
  system = random_system(7, 3, 2, 2, 4);
  EXPECT_EQ(refusal(), "stages = 5: must be 4, as many as the system has");
  system = random_system(7, 3, 2, 2);
  task.stages = std::numeric_limits<Index>::max();
  EXPECT_EQ(refusal(), "stages = 2147483647: the matrices of all stages must have fewer than 2^31 entries");
}

TEST_F(Task, RefusesBadWeights) {
  task.Q[1] = 5.0;
  EXPECT_EQ(refusal(), "Q[3] = 0: must be symmetric: entry (0, 1) is 5");
  task.Q = Values(8, 0.0);
  EXPECT_EQ(refusal(), "Q = 8: must have 9 entries, or 5 times as many");
  task.Q = Values(45, 0.0);
  task.Q[2 * 9 + 4] = kNan;
  EXPECT_EQ(refusal(), "Q[2][4] = nan: must be finite");
  task.Q = Values(9, 0.0);
  task.regularization = -1.0;
  EXPECT_EQ(refusal(), "regularization = -1: must be finite and >= 0");
}

TEST_F(Task, RefusesBadBounds) {
  task.u_lb = {0.0, 2.0}, task.u_ub = {1.0, 1.0};
  EXPECT_EQ(refusal(), "u_ub[1] = 1: must be >= u_lb, 2");
  task.u_ub = {1.0, kNan};
  EXPECT_EQ(refusal(), "u_ub[1] = nan: must be a number or infinity");
  task.u_lb = {0.0};
  EXPECT_EQ(refusal(), "u_lb = 1: must have 2 entries, or 5 times as many, or none");
  task.u_lb = {}, task.u_ub = {}, task.max_u_change = {1.0, -1.0};
  EXPECT_EQ(refusal(), "max_u_change[1] = -1: must be >= 0");
  task.max_u_change = {}, task.x_lb = Values(3, std::numeric_limits<double>::infinity());
  EXPECT_EQ(refusal(), "x_lb[0] = inf: must be a number or -infinity");
}

TEST_F(Task, RefusesBadTargets) {
  task.x_ref = Values(5 * 3, 0.0);
  EXPECT_EQ(refusal(), "x_ref = 15: must have 3 entries, or 6 times as many");
  task.x_ref = Values(6 * 3, 0.0);
  task.x_ref[4] = kNan;
  EXPECT_EQ(refusal(), "x_ref[1][1] = nan: must be finite");
}

TEST_F(Task, TakesTheTerminalCostFromTheRiccatiEquation) {
  task.P = {};
  const auto planner = LcsPlanner::create(system.view(), task).value();
  const Eigen::Map<const testing::Rows> A(system.A.data(), 3, 3), B(system.B.data(), 3, 2),
      Q(task.Q.data(), 3, 3), R(task.R.data(), 2, 2), P(planner.terminal_cost().data(), 3, 3);
  const testing::Rows gain = (R + B.transpose() * P * B).inverse() * B.transpose() * P * A;
  const testing::Rows error = Q + A.transpose() * P * A - A.transpose() * P * B * gain - P;
  EXPECT_LT(error.cwiseAbs().maxCoeff(), 1e-11 * P.cwiseAbs().maxCoeff());
}

TEST_F(Task, NeedsATerminalCostWhereTheRiccatiEquationHasNoSolution) {
  task.P = {};
  system.A = testing::diagonal({2, 0.5, 0.5}), system.B = {0, 0, 1, 0, 0, 1};
  EXPECT_EQ(refusal(), "P: must be given: the Riccati equation of A, B, Q and R has no stabilizing solution");
  task.R = Values(4, 0.0);
  EXPECT_EQ(refusal(), "P: must be given, as R is not positive definite: there is no Riccati equation");
}

}  // namespace
}  // namespace marble
