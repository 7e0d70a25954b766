// A sequence of solves: where each starts, and what a restart may say.
#include "marble/warm_solver.h"

#include <gtest/gtest.h>

#include <limits>

#include "marble/examples.h"

namespace marble {
namespace {

using Values = std::vector<double>;

TEST(Shift, MovesABlockOnAndRepeatsItsLastStage) {
  Values values = {0, 1, 2, 3, 4, 5, 6, 7};
  shift(std::vector<ShiftBlock>{{.first = 1, .count = 6, .by = 2}}, values);
  EXPECT_EQ(values, (Values{0, 3, 4, 5, 6, 5, 6, 7}));
}

TEST(Shift, OfStagesMovesEveryVectorByOne) {
  const OwnedProblem p = examples::hopper();
  const Shift shift = Shift::by_stage(p.view(), 60);
  ASSERT_EQ(shift.variables.size(), 1u);
  EXPECT_EQ(shift.variables[0].count, static_cast<Index>(p.g.size()));
  EXPECT_EQ(shift.variables[0].by, static_cast<Index>(p.g.size()) / 60);
  EXPECT_EQ(shift.pairs[0].by, 9);
}

TEST(Restart, NamesTheBlockAndTheBoundItBroke) {
  const OwnedProblem p = examples::rocket();
  const PartSizes sizes = PartSizes::of(Problem::create(p.view()).value());
  const auto fault = [&](const Restart& restart) { return restart.check(sizes).error(); };
  Restart beyond;
  beyond.shift.pairs = {{.first = 0, .count = 1, .by = 1}, {.first = 1, .count = 1 << 30, .by = 0}};
  EXPECT_EQ(fault(beyond).field, "shift.pairs[1].count");
  EXPECT_EQ(fault(beyond).bound, "must be in [0, " + std::to_string(sizes.l - 1) + "]");
  Restart backward;
  backward.shift.variables = {{.first = 0, .count = 2, .by = -1}};
  EXPECT_EQ(fault(backward).field, "shift.variables[0].by");
  Values z(p.g.size(), 0.0);
  z[3] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(fault({.initial_z = z}).field, "initial_z");
  EXPECT_EQ(fault({.initial_z = z}).index, 3);
  z.pop_back();
  EXPECT_EQ(fault({.initial_z = z}).field, "initial_z");
}

TEST(WarmSolver, StartsFromItsLastAnswerAsASolverThatIsGivenIt) {
  OwnedProblem p = examples::hopper();
  const Problem problem = Problem::create(p.view()).value();
  WarmSolver warm = WarmSolver::create(problem, {}, p.initial_z).value();
  Solver plain = Solver::create(problem).value();
  const Solution first = warm.solve().value();
  const Solution expected_first = plain.solve({.initial_z = p.initial_z}).value();
  EXPECT_EQ(first.z, expected_first.z);
  Values b = p.b;
  b[0] += 1e-3;
  ASSERT_TRUE(plain.update({.b = b}).has_value());
  const Solution expected = plain.solve({.initial_z = p.initial_z, .warm_start = &expected_first}).value();
  const Solution second = warm.solve({.b = b}).value();
  ASSERT_EQ(second.status, Status::solved) << second.detail;
  EXPECT_EQ(second.z, expected.z);
  EXPECT_LT(second.factorizations, first.factorizations);
  EXPECT_EQ(second.times.setup_s, 0.0);
}

TEST(WarmSolver, ForgetsItsLastAnswerWhenAskedTo) {
  const OwnedProblem p = examples::hopper();
  WarmSolver solver = WarmSolver::create(Problem::create(p.view()).value(), {}, p.initial_z).value();
  const Solution first = solver.solve().value();
  const Solution cold = solver.solve({}, {.cold = true}).value();
  EXPECT_EQ(cold.z, first.z);
  EXPECT_EQ(cold.factorizations, first.factorizations);
}

TEST(WarmSolver, ARefusedUpdateChangesNothing) {
  const OwnedProblem p = examples::rocket();
  WarmSolver solver = WarmSolver::create(Problem::create(p.view()).value()).value();
  WarmSolver untouched = WarmSolver::create(Problem::create(p.view()).value()).value();
  static_cast<void>(solver.solve().value());
  static_cast<void>(untouched.solve().value());
  Restart wrong;
  wrong.cold = true;
  wrong.shift.variables = {{.first = -1, .count = 0, .by = 0}};
  const Values g(p.g.size(), 1.0);
  EXPECT_EQ(solver.solve({.g = g}, wrong).error().field, "shift.variables[0].first");
  EXPECT_EQ(solver.solve({.g = std::span(g).first(2)}, {.cold = true}).error().field, "g");
  EXPECT_EQ(solver.solve().value().z, untouched.solve().value().z);
}

}  // namespace
}  // namespace marble
