// Limits of states and inputs that differ by stage and change with a control step.
#include <gtest/gtest.h>

#include <limits>

#include "lcs_systems.h"
#include "marble/warm_solver.h"

namespace marble {
namespace {

using testing::cart_pole;
using testing::cart_pole_task;
using testing::Values;

constexpr double kNone = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const Values kState = {0.3, 0.3, 0.9, 0.5};

// Three stages, limits of the first state from above and of the input from both sides.
LcsTask limited() {
  LcsTask task = cart_pole_task(3);
  task.x_ub = {2.0, kNone, kNone, kNone};
  task.u_lb = {-9.0}, task.u_ub = {9.0};
  return task;
}

Values rows(std::initializer_list<double> of_first) {
  Values made;
  for (const double limit : of_first) made.insert(made.end(), {limit, kNone, kNone, kNone});
  return made;
}

TEST(LcsLimits, HaveOneRowPerStageWithTheLimitOfThatStage) {
  LcsTask task = limited();
  task.x_ub = rows({2.0, 3.0, 4.0});
  task.u_lb = {-7.0, -8.0, -9.0};
  auto planner = LcsPlanner::create(cart_pole().view(), task).value();
  const auto d = [&] { return Values(planner.problem().d.begin(), planner.problem().d.end()); };
  EXPECT_EQ(d(), (Values{7, 9, 2, 8, 9, 3, 9, 9, 4}));  // u − lb, ub − u and x_ub − x of each stage
  const Values x_ub = rows({0.5, 0.75, 1.0}), u_ub = {6.0};
  const LcsUpdate update = planner.begin({.x0 = kState, .x_ub = x_ub, .u_ub = u_ub}).value();
  EXPECT_EQ(d(), (Values{7, 6, 0.5, 8, 6, 0.75, 9, 6, 1}));
  EXPECT_EQ(Values(update.numbers.d.begin(), update.numbers.d.end()), d());
  ASSERT_TRUE(planner.begin({.x0 = kState}).has_value());  // they stay, and do not move on
  EXPECT_EQ(d(), (Values{7, 6, 0.5, 8, 6, 0.75, 9, 6, 1}));
}

TEST(LcsLimits, OfAStepGiveThePlanOfAPlannerThatHasThemFromTheBeginning) {
  LcsTask before = cart_pole_task(10), after = before;
  before.x_lb = {-kNone, -kNone, -5.0, -kNone}, before.u_lb = {-50.0}, before.u_ub = {50.0};
  after.u_lb = Values(10, -20.0), after.u_ub = {20.0};
  for (int k = 0; k < 10; ++k) after.x_lb.insert(after.x_lb.end(), {-kNone, -kNone, 0.85 - 0.05 * k, -kNone});
  const auto plan_of = [](const LcsTask& task, const LcsStep& step) {
    auto planner = LcsPlanner::create(cart_pole().view(), task).value();
    auto solver = WarmSolver::create(Problem::create(planner.problem()).value()).value();
    return planner.step(solver, step).value();
  };
  const LcsPlan loose = plan_of(before, {.x0 = kState});
  const LcsPlan expected = plan_of(after, {.x0 = kState});
  const LcsPlan plan =
      plan_of(before, {.x0 = kState, .x_lb = after.x_lb, .u_lb = after.u_lb, .u_ub = after.u_ub});
  ASSERT_TRUE(plan.feasible) << plan.detail;
  EXPECT_EQ(plan.u, expected.u);
  EXPECT_EQ(plan.objective, expected.objective);
  EXPECT_GT(plan.objective, loose.objective);  // they count
  for (std::size_t k = 0; k < 10; ++k) EXPECT_GE(plan.x[4 * (k + 1) + 2], after.x_lb[4 * k + 2] - 1e-6) << k;
}

TEST(LcsLimits, ClipTheStartStageByStage) {
  auto planner = LcsPlanner::create(cart_pole().view(), limited()).value();
  const Values u = {5.0, 5.0, 5.0}, u_ub = {1.0, 2.0, 8.0};
  ASSERT_TRUE(planner.begin({.x0 = kState, .u = u, .u_ub = u_ub}).has_value());
  const LcsPlan plan = planner.finish({.status = Status::time_limit}).value();
  EXPECT_EQ(plan.u, (Values{1.0, 2.0, 5.0}));
  EXPECT_TRUE(plan.feasible) << plan.detail;
}

// A start beyond the limit is reported with the stage, and the plan that keeps it is returned.
TEST(LcsLimits, JudgeTheStartByTheLimitOfEachStage) {
  auto planner = LcsPlanner::create(cart_pole().view(), limited()).value();
  auto solver = WarmSolver::create(Problem::create(planner.problem()).value()).value();
  const Values x0 = {0.0, 0.0, 1.0, 0.0}, x_ub = rows({1.0, 1.0, 0.0299});
  const LcsPlan plan = planner.step(solver, {.x0 = x0, .x_ub = x_ub}).value();
  EXPECT_TRUE(plan.feasible) << plan.detail;
  EXPECT_LE(plan.x[12], 0.0299 + 1e-6);
  EXPECT_EQ(plan.start_objective, kNone);
  EXPECT_NE(plan.detail.find("x_ub[0] is violated by"), std::string::npos) << plan.detail;
  EXPECT_NE(plan.detail.find("in stage 3"), std::string::npos) << plan.detail;
}

TEST(LcsLimits, OfATaskAreNamedWhereTheyAreWrong) {
  const auto refusal = [](auto change) {
    LcsTask task = limited();
    change(task);
    return LcsPlanner::create(cart_pole().view(), task).error().message();
  };
  EXPECT_EQ(refusal([](LcsTask& t) { t.x_ub.resize(8, kNone); }),
            "x_ub = 8: must have 4 entries, or 3 times as many, or none");
  EXPECT_EQ(refusal([](LcsTask& t) {
              t.x_ub = rows({1.0, kNan, 1.0});
            }),
            "x_ub[1][0] = nan: must be a number or infinity");
  EXPECT_EQ(refusal([](LcsTask& t) {
              t.x_ub = rows({1.0, 1.0, -kNone});
            }),
            "x_ub[2][0] = -inf: must be a number or infinity");
  EXPECT_EQ(refusal([](LcsTask& t) {
              t.x_ub = rows({1.0, 1e20, 1.0});
            }),
            "x_ub[1][0] = 1e+20: must be finite in all stages or in none");
  EXPECT_EQ(refusal([](LcsTask& t) { t.u_lb = {1.0, 9.5, 1.0}; }), "u_ub[1][0] = 9: must be >= u_lb, 9.5");
  EXPECT_EQ(refusal([](LcsTask& t) {
              t.max_u_change = {1.0, 1.0, 1.0};
            }),
            "max_u_change = 3: must have 1 entries, or none");
}

TEST(LcsLimits, OfAStepAreNamedWhereTheyAreWrongAndChangeNothing) {
  auto planner = LcsPlanner::create(cart_pole().view(), limited()).value();
  const Values before(planner.problem().d.begin(), planner.problem().d.end());
  const auto refusal = [&](LcsStep step) {
    step.x0 = kState;
    return planner.begin(step).error().message();
  };
  const Values good = rows({1.0}), low = rows({1.0, 1.0, 1.0}), u_nan = {kNan}, u_high = {10.0},
               u_low = {-10.0}, short_row = {1.0};
  EXPECT_EQ(refusal({.x_ub = short_row}), "x_ub = 1: must have 4 entries, or 3 times as many");
  Values bad = low;
  bad[4] = kNone;
  EXPECT_EQ(refusal({.x_ub = bad}),
            "x_ub[1][0] = inf: must be finite, as at the beginning: the rows of the LCQP are fixed");
  bad = good, bad[2] = 3.0;
  EXPECT_EQ(refusal({.x_ub = bad}),
            "x_ub[2] = 3: must be infinite, as at the beginning: the LCQP has no row for it");
  bad = Values(4, -kNone), bad[1] = -1.0;
  EXPECT_EQ(refusal({.x_lb = bad}),
            "x_lb[1] = -1: must be infinite, as at the beginning: the LCQP has no row for it");
  EXPECT_EQ(refusal({.u_lb = u_nan}), "u_lb[0] = nan: must be a number or -infinity");
  EXPECT_EQ(refusal({.x_ub = good, .u_lb = u_high}), "u_lb[0] = 10: must be <= u_ub, 9");
  EXPECT_EQ(refusal({.u_lb = u_high, .u_ub = u_low}), "u_ub[0] = -10: must be >= u_lb, 10");
  EXPECT_EQ(Values(planner.problem().d.begin(), planner.problem().d.end()), before);
}

// Of a limit that stays, the stages count too.
TEST(LcsLimits, OfAStepAreNamedAgainstThoseThatStay) {
  LcsTask task = limited();
  task.u_ub = {9.0, 8.0, 7.0};
  auto planner = LcsPlanner::create(cart_pole().view(), task).value();
  const Values u_lb = {7.5};
  EXPECT_EQ(planner.begin({.x0 = kState, .u_lb = u_lb}).error().message(),
            "u_lb[2][0] = 7.5: must be <= u_ub, 7");
}

}  // namespace
}  // namespace marble
