// A sequence of solves: where each starts, and what a restart may say.
#include "marble/warm_solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <string>

#include "marble/examples.h"
#include "support/random_problem.h"

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
  const Shift shift = Shift::by_stage(p.view(), 60).value();
  ASSERT_EQ(shift.variables.size(), 1u);
  EXPECT_EQ(shift.variables[0].count, static_cast<Index>(p.g.size()));
  EXPECT_EQ(shift.variables[0].by, static_cast<Index>(p.g.size()) / 60);
  EXPECT_EQ(shift.pairs[0].by, 9);
}

TEST(Shift, OfStagesThatDoNotDivideAVectorIsRefused) {
  OwnedProblem p;
  p.g = Values(6);
  p.b = Values(4);
  const auto fault = [&](int stages) {
    const Error error = Shift::by_stage(p.view(), stages).error();
    return error.field + " = " + error.value + ": " + error.bound;
  };
  EXPECT_TRUE(Shift::by_stage(p.view(), 2).has_value());
  EXPECT_EQ(fault(4), "stages = 4: must divide the number of variables, 6");
  EXPECT_EQ(fault(3), "stages = 3: must divide the number of equalities, 4");
  EXPECT_EQ(fault(0), "stages = 0: must be a whole number >= 1");
}

TEST(Shift, JoinedMovesAsOneAfterTheOtherDoes) {
  constexpr std::size_t kSize = 23;
  std::mt19937 random(7);
  const auto below = [&](Index bound) {
    return static_cast<Index>(random() % static_cast<unsigned>(bound + 1));
  };
  for (int trial = 0; trial < 200; ++trial) {
    Values one_by_one(kSize), at_once(kSize);
    std::iota(one_by_one.begin(), one_by_one.end(), 0.0);
    at_once = one_by_one;
    std::vector<ShiftBlock> all;
    for (int i = 0; i < 1 + trial % 9; ++i) {
      ShiftBlock block;
      block.first = below(kSize);
      block.count = below(static_cast<Index>(kSize) - block.first);
      block.by = below(block.count);
      all = joined(all, {{block}}, kSize);
      shift({{block}}, one_by_one);
    }
    shift(all, at_once);
    ASSERT_EQ(at_once, one_by_one) << "trial " << trial;
    const PartSizes sizes{.g = kSize};
    EXPECT_TRUE((Restart{.shift = {.variables = all}}.check(sizes))) << "it would be refused";
  }
}

TEST(Shift, JoinedAThousandTimesIsNoLongerThanTheVectorHasStages) {
  std::vector<ShiftBlock> all;
  for (int i = 0; i < 1000; ++i) all = joined(all, {{{.first = 0, .count = 60, .by = 3}}}, 60);
  EXPECT_EQ(all.size(), 19u);
}

TEST(Restart, MovesNoMoreEntriesThanThereAre) {
  const PartSizes sizes{.g = 6};
  const ShiftBlock whole{.first = 0, .count = 6, .by = 1}, still{.first = 0, .count = 6, .by = 0}, empty{};
  const auto check = [&](std::vector<ShiftBlock> blocks) {
    return Restart{.shift = {.variables = std::move(blocks)}}.check(sizes);
  };
  EXPECT_TRUE(check({whole, still}));
  EXPECT_TRUE(check(std::vector<ShiftBlock>(6, empty)));
  const Error error = check({whole, whole}).error();
  EXPECT_EQ(error.field, "shift.variables[1]");
  EXPECT_EQ(error.value, "10");
  EXPECT_EQ(check(std::vector<ShiftBlock>(7, empty)).error().field, "shift.variables[6]");
  EXPECT_EQ(check(std::vector<ShiftBlock>(7, still)).error().field, "shift.variables[6]");
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

TEST(CheckedUpdate, IsRefusedByTheFirstOfItsPartsThatDoesNotFit) {
  const PartSizes sizes{.g = 2};
  const Values g = {1.0, std::numeric_limits<double>::infinity()};
  EXPECT_EQ(CheckedUpdate::check(sizes, {.g = g}).error().message(), "g[1] = inf: must be finite");
  EXPECT_EQ(CheckedUpdate::check(sizes, {.g = std::span(g).first(1)}).error().field, "g");
  const Restart restart{.shift = {.variables = {{.first = 0, .count = 3, .by = 1}}}};
  EXPECT_EQ(CheckedUpdate::check(sizes, {}, restart).error().field, "shift.variables[0].count");
  EXPECT_TRUE(CheckedUpdate::check(sizes, {.g = Values{1.0, 2.0}}).has_value());
}

TEST(WarmSolver, SolvesWhatWasCheckedBeforeAsWhatItChecksItself) {
  const OwnedProblem p = examples::rocket();
  const Problem problem = Problem::create(p.view()).value();
  WarmSolver one = WarmSolver::create(problem).value();
  WarmSolver other = WarmSolver::create(problem).value();
  Options few;
  few.max_iterations = 3;
  const Values b(p.b.size(), 0.0);
  ASSERT_TRUE(one.set_options(few).has_value());
  const CheckedUpdate update = CheckedUpdate::of_checked(PartSizes::of(problem), {.b = b}, {}, few);
  EXPECT_EQ(other.solve(update).value().z, one.solve({.b = b}).value().z);
  EXPECT_EQ(other.solve().value().iterations, one.solve().value().iterations) << "the options are gone";
}

TEST(WarmSolver, RefusesWhatWasCheckedForOtherSizes) {
  WarmSolver solver = WarmSolver::create(Problem::create(examples::rocket().view()).value()).value();
  const auto update = CheckedUpdate::check({.g = 2}, {}).value();
  EXPECT_EQ(solver.solve(update).error().code, ErrorCode::failed_precondition);
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

// A planner's ticks, each with new matrices, of which b alone is known late.
TEST(WarmSolver, TwoPartsGiveTheBitsOfOneUpdateOfBoth) {
  examples::HopperParameters parameters{.steps = 12};
  const OwnedProblem first = examples::hopper(parameters);
  const Problem problem = Problem::create(first.view()).value();
  WarmSolver whole = WarmSolver::create(problem).value(), parts = WarmSolver::create(problem).value();
  const Shift shift = Shift::by_stage(first.view(), parameters.steps).value();
  for (int tick = 0; tick < 8; ++tick) {
    const OwnedProblem now = examples::hopper(parameters);
    Values A = now.A.values, Q = now.Q.values;
    for (double& value : Q) value *= 1.0 + 0.01 * tick;
    const Restart restart{.shift = tick > 0 ? shift : Shift{}};
    if (tick % 3 == 1) {  // a first part that is said twice
      ASSERT_TRUE(parts.prepare({.Q = Q, .A = A}, restart).has_value());
      ASSERT_TRUE(parts.prepare({.c0 = now.c0, .g = now.g, .d = now.d}).has_value());
    } else {
      ASSERT_TRUE(parts.prepare({.c0 = now.c0, .g = now.g, .d = now.d, .Q = Q, .A = A}, restart).has_value());
    }
    const Solution two = parts.solve({.b = now.b}).value();
    const Solution one =
        whole.solve({.c0 = now.c0, .g = now.g, .b = now.b, .d = now.d, .Q = Q, .A = A}, restart).value();
    ASSERT_EQ(two.z, one.z) << "tick " << tick;
    EXPECT_EQ(two.equality_multipliers, one.equality_multipliers);
    EXPECT_EQ(two.complementarity_multipliers_L, one.complementarity_multipliers_L);
    EXPECT_EQ(two.factorizations, one.factorizations);
    EXPECT_EQ(two.detail, one.detail);
    parameters = examples::advance(parameters, one.z);
  }
}

TEST(WarmSolver, ASecondPartMayChangeWhatTheFirstMadeReady) {
  const OwnedProblem first = examples::hopper({.steps = 12});
  const Problem problem = Problem::create(first.view()).value();
  WarmSolver whole = WarmSolver::create(problem).value(), parts = WarmSolver::create(problem).value();
  ASSERT_EQ(parts.solve().value().z, whole.solve().value().z);
  Values Q = first.Q.values, d = first.d;
  for (double& value : Q) value *= 2.0;
  for (double& value : d) value += 0.01;
  ASSERT_TRUE(parts.prepare({.g = first.g}).has_value());
  const Solution two = parts.solve({.d = d, .Q = Q}).value(), one = whole.solve({.d = d, .Q = Q}).value();
  EXPECT_EQ(two.z, one.z);
  EXPECT_EQ(two.factorizations, one.factorizations);
  ASSERT_TRUE(parts.prepare({.g = first.g}, {.cold = true}).has_value());
  EXPECT_EQ(parts.solve().value().z, whole.solve({}, {.cold = true}).value().z);
}

// The scale factors are fitted to the numbers of solves alone.
TEST(WarmSolver, NumbersThatAreReplacedBeforeTheSolveLeaveNoTrace) {
  const OwnedProblem first = examples::hopper({.steps = 12});
  const Problem problem = Problem::create(first.view()).value();
  for (const double size : {1e-200, 1e12, 1e200}) {
    WarmSolver whole = WarmSolver::create(problem).value(), parts = WarmSolver::create(problem).value();
    ASSERT_EQ(parts.solve().value().z, whole.solve().value().z);
    Values far = first.g, Q = first.Q.values, b = first.b;
    for (double& value : far) value += size;
    for (double& value : Q) value *= size;
    for (double& value : b) value *= 1.01;
    ASSERT_TRUE(parts.prepare({.g = far}).has_value());
    ASSERT_TRUE(parts.prepare({.g = first.g, .Q = Q}).has_value());
    const Solution two = parts.solve({.b = b, .Q = first.Q.values}).value();
    const Solution one = whole.solve({.g = first.g, .b = b, .Q = first.Q.values}).value();
    EXPECT_EQ(two.z, one.z) << size;
    EXPECT_EQ(two.factorizations, one.factorizations) << size;
  }
}

TEST(WarmSolver, AShiftMovesTheLastSolutionAndNoInitialPoint) {
  const examples::HopperParameters parameters{.steps = 12};
  const OwnedProblem p = examples::hopper(parameters);
  const Problem problem = Problem::create(p.view()).value();
  const Restart shifted{.shift = Shift::by_stage(p.view(), parameters.steps).value()};
  WarmSolver whole = WarmSolver::create(problem).value(), parts = WarmSolver::create(problem).value();
  const Values start = whole.solve().value().z;
  ASSERT_EQ(parts.solve().value().z, start);
  ASSERT_TRUE(parts.prepare({}, {.initial_z = start}).has_value());
  const Solution two = parts.solve({}, shifted).value();
  const Solution one = whole.solve({}, {.initial_z = start, .shift = shifted.shift}).value();
  EXPECT_EQ(two.z, one.z);
  EXPECT_EQ(two.factorizations, one.factorizations);
}

TEST(WarmSolver, AFirstPartThatIsWrongChangesNothing) {
  const OwnedProblem first = examples::hopper({.steps = 12});
  WarmSolver solver = WarmSolver::create(Problem::create(first.view()).value()).value();
  const Solution before = solver.solve().value();
  const Values few = {1.0};
  EXPECT_EQ(solver.prepare({.g = few}).error().field, "g");
  EXPECT_EQ(solver.prepare({}, {.initial_z = few}).error().field, "initial_z");
  EXPECT_EQ(solver.solve().value().objective, before.objective);
}

// A spring with one pair, force ⊥ gap, that a larger reward on the force makes better pressed against the
// wall: the branch of the last solution stays a local minimum.
TEST(WarmSolver, LeavesTheBranchOfOnePairWhenTheOtherOneIsBetter) {
  OwnedProblem p;
  Triplets Q, A, L, R;
  Q.add(0, 0, 1.0);
  Q.add(2, 2, 1.0);
  A.add(0, 0, 1.0);
  A.add(0, 1, -1.0);
  A.add(0, 2, -1.0);
  L.add(0, 2, 1.0);
  R.add(0, 1, -1.0);
  p.Q = compress(3, 3, Q, "Q").value();
  p.A = compress(1, 3, A, "A").value();
  p.C = compress(0, 3, {}, "C").value();
  p.L = compress(1, 3, L, "L").value();
  p.R = compress(1, 3, R, "R").value();
  p.g = {-0.4, 0.0, 0.0};
  p.b = p.l = {0.0};
  p.r = {0.5};
  WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
  EXPECT_NEAR(session.solve().value().objective, -0.08, 1e-9);
  const Values rewarded = {-0.4, 0.0, -0.5};
  const Solution warm = session.solve({.g = rewarded}).value();
  EXPECT_NEAR(warm.objective, -0.115, 1e-9) << warm.detail;
  EXPECT_TRUE(warm.proved) << warm.detail;
  const Solution again = session.solve({.g = rewarded}).value();
  EXPECT_NEAR(again.objective, -0.115, 1e-9);
  EXPECT_EQ(again.factorizations, 1) << "nothing to search: " << again.detail;
  EXPECT_NEAR(session.solve({.g = p.g}).value().objective, -0.08, 1e-9);
  ASSERT_TRUE(session.set_options({.effort = 0.0}).has_value());
  EXPECT_NEAR(session.solve({.g = rewarded}).value().objective, -0.08, 1e-9) << "the branch alone";
}

TEST(WarmSolver, WithFewPairsIsNeverAboveAColdSolve) {
  int searched = 0;
  for (const Index pairs : {1, 3, 6}) {
    OwnedProblem p = testing::random_problem({.variables = 14, .pairs = pairs}, 3);
    WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
    static_cast<void>(session.solve().value());
    std::mt19937 random(5);
    for (int step = 0; step < 20; ++step) {
      for (double& entry : p.g) entry += static_cast<double>(random() % 1000U) / 1000.0 - 0.5;
      const Solution warm = session.solve({.g = p.g}).value(), cold = solve_in_process(p.view()).value();
      ASSERT_EQ(warm.status, Status::solved) << warm.detail;
      EXPECT_LE(warm.objective, cold.objective + 1e-6 * (1.0 + std::abs(cold.objective)))
          << pairs << " pairs, step " << step << ": " << warm.detail;
      searched += warm.detail.find("max_small_problem_nodes") != std::string::npos ? 1 : 0;
    }
  }
  EXPECT_GT(searched, 5);
  EXPECT_LT(searched, 45) << "many steps need no tree";
}

}  // namespace
}  // namespace marble
