// Real-time iteration: one LCQP a tick, and what a tick returns that has no answer.
#include "marble/real_time.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "hopping_robot.h"

namespace marble::testing {
namespace {

using nonlinear::Fallback;
using nonlinear::Outcome;
using nonlinear::RealTime;
using nonlinear::RealTimeSettings;

constexpr Index kHorizon = 30;   // stages of 20 ms
constexpr int kLoopTicks = 100;  // two seconds
const nonlinear::Measured kWholeState = {.equalities = {0, 1, 2, 3}};

// What becomes of two seconds at 50 Hz.
struct ClosedLoop {
  double cost = 0.0;
  double highest_foot = 0.0;
  int answered = 0;
  int lcqps = 0, most_lcqps = 0;  // of all ticks, and of one
  std::int64_t factorizations = 0;

  void count(bool answer, int of_tick, std::int64_t factored) {
    answered += answer ? 1 : 0;
    lcqps += of_tick, most_lcqps = std::max(most_lcqps, of_tick);
    factorizations += factored;
  }
};

// Pushes that no plan knows of, the same in every run.
HoppingRobot::State pushed(HoppingRobot::State state, int tick) {
  if (tick % 10 == 7) state[HoppingRobot::kSpeed] += tick % 20 == 7 ? 0.2 : -0.2;
  return state;
}

// `plan` gives the plan of a tick for a state; its first torque is what the robot gets.
template <class Plan>
ClosedLoop followed(Plan&& plan) {
  ClosedLoop loop;
  HoppingRobot::State state = HoppingRobot::standing();
  for (int tick = 0; tick < kLoopTicks; ++tick) {
    const std::vector<double> x = plan(tick, state, loop);
    const double torque = x[HoppingRobot::at(0, HoppingRobot::kTorque)];
    state = pushed(step_of_the_world(state, torque, std::span(x).subspan(HoppingRobot::at(0, 0))), tick);
    loop.cost += HoppingRobot::cost(state, torque, tick + 1);
    loop.highest_foot = std::max(loop.highest_foot, HoppingRobot::foot_height(state));
  }
  return loop;
}

template <class Value>
Value value_of(Expected<Value> expected) {
  if (!expected) throw std::runtime_error(expected.error().message());
  return std::move(*expected);
}

std::vector<double> converged_plan(HoppingRobot& robot) {
  robot.set(0, HoppingRobot::standing());
  const auto answer = value_of(nonlinear::solve(robot.problem(), nonlinear::open_ticks_in_process));
  if (!is_solved(answer.status)) throw std::runtime_error(answer.detail);
  return answer.x;
}

ClosedLoop by_full_convergence() {
  HoppingRobot robot(kHorizon);
  nonlinear::Problem problem = robot.problem();
  problem.start = converged_plan(robot);
  const Shift one_stage = robot.one_stage();
  return followed([&](int tick, const HoppingRobot::State& state, ClosedLoop& loop) {
    if (tick > 0) shift(one_stage.variables, problem.start);
    robot.set(tick, state);
    const auto answer = value_of(nonlinear::solve(problem, nonlinear::open_ticks_in_process));
    loop.count(is_solved(answer.status), answer.ticks, answer.factorizations);
    return problem.start = answer.x;
  });
}

RealTime loop_of(HoppingRobot& robot, RealTimeSettings settings = {},
                 const nonlinear::Measured& measured = kWholeState,
                 const nonlinear::OpenTicks& open = nonlinear::open_ticks_in_process) {
  nonlinear::Problem problem = robot.problem();
  problem.start = converged_plan(robot);
  robot.set(0);
  settings.shift = robot.one_stage();
  return value_of(RealTime::create(problem, measured, open, settings));
}

ClosedLoop in_real_time() {
  HoppingRobot robot(kHorizon);
  RealTime real_time = loop_of(robot);
  return followed([&](int tick, const HoppingRobot::State& state, ClosedLoop& loop) {
    robot.set(tick);
    if (auto ready = real_time.prepare(); !ready) throw std::runtime_error(ready.error().message());
    const auto plan = value_of(real_time.feedback(state));
    loop.count(plan.outcome == Outcome::answered, plan.ticks, plan.factorizations);
    return plan.x;
  });
}

TEST(RealTimeHopper, HasTheDerivativesItClaims) {
  HoppingRobot robot(3);
  nonlinear::Problem problem = robot.problem();
  for (double& entry : problem.start) entry += 0.1;
  const auto agree = nonlinear::check_derivatives(problem, problem.start);
  EXPECT_TRUE(agree.has_value()) << agree.error().message();
}

TEST(RealTimeHopper, CostsAtMostFivePercentMoreThanFullConvergenceByOneLcqpATick) {
  const ClosedLoop fast = in_real_time();
  const ClosedLoop full = by_full_convergence();
  EXPECT_LE(fast.cost, 1.05 * full.cost);
  EXPECT_EQ(fast.answered, kLoopTicks);
  EXPECT_EQ(fast.most_lcqps, 1);
  EXPECT_EQ(full.answered, kLoopTicks);
  EXPECT_GT(fast.highest_foot, 0.05);  // it hops
  EXPECT_GE(full.lcqps, 5 * fast.lcqps);
  EXPECT_GE(full.factorizations, 5 * fast.factorizations);
  RecordProperty("costs", std::to_string(fast.cost) + " " + std::to_string(full.cost));
  RecordProperty("lcqps", std::to_string(fast.lcqps) + " " + std::to_string(full.lcqps));
  RecordProperty("factorizations",
                 std::to_string(fast.factorizations) + " " + std::to_string(full.factorizations));
}

// Too short to reach another branch than the plan's own.
RealTimeSettings with_short_steps() {
  RealTimeSettings settings;
  settings.radius = 0.01;
  return settings;
}

TEST(RealTime, StaysAtASolutionThatIsMeasuredAsPlanned) {
  HoppingRobot robot(kHorizon);
  const std::vector<double> plan = converged_plan(robot);
  RealTime real_time = loop_of(robot, with_short_steps());
  const auto tick = value_of(real_time.feedback(HoppingRobot::standing()));
  EXPECT_EQ(tick.outcome, Outcome::answered);
  EXPECT_TRUE(tick.deadline_met);
  EXPECT_EQ(tick.why, "");
  EXPECT_LE(tick.step, 1e-5);
  EXPECT_LE(tick.violation, 1e-8);
  ASSERT_EQ(tick.x.size(), plan.size());
  for (std::size_t j = 0; j < plan.size(); ++j) EXPECT_NEAR(tick.x[j], plan[j], 1e-5) << j;
  EXPECT_EQ(tick.multipliers.equalities.size(), 4u * (kHorizon + 1));
}

TEST(RealTime, TakesAMeasurementByVariablesAsByRows) {
  HoppingRobot by_rows(kHorizon), by_variables(kHorizon);
  RealTime rows = loop_of(by_rows);
  // The first four rows hold what they held in the first plan; the variables' own come after them.
  nonlinear::Problem problem = by_variables.problem();
  problem.start = converged_plan(by_variables);
  by_variables.set(0);
  const auto given = problem.values;
  std::vector<double> later;
  problem.values = [&](std::span<const double> x) {
    nonlinear::Values values = given(x);
    later.assign(values.equalities.begin() + 4, values.equalities.end());
    values.equalities = later;
    return values;
  };
  SparseMatrix fewer;
  const auto slopes = problem.derivatives;
  problem.derivatives = [&](std::span<const double> x) {
    nonlinear::Derivatives derivatives = slopes(x);
    const SparseMatrixView& all = derivatives.equalities;
    fewer = {all.rows - 4, all.columns, {0}, {}, {}};
    for (Index j = 0; j < all.columns; ++j) {
      for (Index k = all.column_pointers[j]; k < all.column_pointers[j + 1]; ++k) {
        if (all.row_indices[k] < 4) continue;
        fewer.row_indices.push_back(all.row_indices[k] - 4), fewer.values.push_back(all.values[k]);
      }
      fewer.column_pointers.push_back(static_cast<Index>(fewer.row_indices.size()));
    }
    derivatives.equalities = fewer.view();
    return derivatives;
  };
  problem.lower[0] = 10.0;  // of what is measured bounds do not count
  RealTime variables =
      value_of(RealTime::create(problem, {.variables = {0, 1, 2, 3}}, nonlinear::open_ticks_in_process));
  HoppingRobot::State state = HoppingRobot::standing();
  state[HoppingRobot::kSpeed] = 0.1;
  const auto one = value_of(rows.feedback(state)), other = value_of(variables.feedback(state));
  ASSERT_EQ(one.outcome, Outcome::answered) << one.why;
  ASSERT_EQ(other.outcome, Outcome::answered) << other.why;
  EXPECT_NEAR(other.x[HoppingRobot::kSpeed], 0.1, 1e-9);
  for (std::size_t j = 0; j < one.x.size(); ++j) EXPECT_NEAR(one.x[j], other.x[j], 1e-6) << j;
  EXPECT_EQ(other.multipliers.equalities.size(), 4u * kHorizon);
}

// What a tick returns whose deadline has passed before its LCQP begins.
nonlinear::RealTimeTick late(Fallback fallback, std::vector<double>& before) {
  HoppingRobot robot(kHorizon);
  RealTimeSettings settings;
  settings.fallback = fallback;
  RealTime real_time = loop_of(robot, settings);
  before = value_of(real_time.feedback(HoppingRobot::standing())).x;
  return value_of(real_time.feedback(HoppingRobot::standing(), 0.0));
}

TEST(RealTime, KeepsOrMovesThePlanOnWhenTheDeadlineHasPassed) {
  const Shift one_stage = HoppingRobot(kHorizon).one_stage();
  std::vector<double> before;
  const auto kept = late(Fallback::keep, before);
  EXPECT_EQ(kept.outcome, Outcome::kept);
  EXPECT_EQ(kept.status, Status::time_limit);
  EXPECT_FALSE(kept.deadline_met);
  EXPECT_NE(kept.why, "");
  EXPECT_EQ(kept.x, before);
  for (const Fallback fallback : {Fallback::shifted, Fallback::elastic}) {
    const auto moved = late(fallback, before);
    EXPECT_EQ(moved.outcome, Outcome::shifted);
    EXPECT_FALSE(moved.deadline_met);
    EXPECT_EQ(moved.ticks, 1);
    shift(one_stage.variables, before);
    EXPECT_EQ(moved.x, before);
  }
}

TEST(RealTime, GoesOnAfterATickWithoutAnAnswer) {
  HoppingRobot robot(kHorizon);
  RealTime real_time = loop_of(robot);
  ASSERT_EQ(value_of(real_time.feedback(HoppingRobot::standing())).outcome, Outcome::answered);
  robot.set(1);
  const auto missed = value_of(real_time.feedback(HoppingRobot::standing(), 0.0));
  robot.set(2);
  ASSERT_TRUE(real_time.prepare().has_value());
  const auto next = value_of(real_time.feedback(HoppingRobot::standing()));
  EXPECT_EQ(next.outcome, Outcome::answered) << next.why;
  EXPECT_LE(next.violation, 1e-6);
}

// A knee that is straightened far beyond what a stage can bend again.
HoppingRobot::State impossible() {
  HoppingRobot::State state = HoppingRobot::standing();
  state[HoppingRobot::kKnee] = 3.0;
  return state;
}

TEST(RealTime, SaysWhichPlanItReturnsWhereTheLcqpHasNone) {
  HoppingRobot robot(kHorizon);
  for (const Fallback fallback : {Fallback::keep, Fallback::shifted, Fallback::elastic}) {
    RealTimeSettings settings;
    settings.fallback = fallback;
    RealTime real_time = loop_of(robot, settings);
    const auto tick = value_of(real_time.feedback(impossible()));
    EXPECT_EQ(tick.outcome, fallback == Fallback::keep      ? Outcome::kept
                            : fallback == Fallback::shifted ? Outcome::shifted
                                                            : Outcome::elastic);
    EXPECT_STREQ(to_string(tick.outcome), fallback == Fallback::keep      ? "kept"
                                          : fallback == Fallback::shifted ? "shifted"
                                                                          : "elastic");
    EXPECT_EQ(tick.ticks, fallback == Fallback::elastic ? 2 : 1);
    EXPECT_FALSE(is_solved(tick.status));
    EXPECT_TRUE(tick.deadline_met);
    EXPECT_NE(tick.why, "");
    EXPECT_GT(tick.violation, 0.1);
  }
}

TEST(RealTime, BeginsAnewWhereItIsReported) {
  HoppingRobot robot(kHorizon);
  RealTime real_time = loop_of(robot, with_short_steps());
  ASSERT_TRUE(real_time.feedback(HoppingRobot::standing()).has_value());
  const std::vector<double> plan = converged_plan(robot);
  robot.set(0);
  ASSERT_TRUE(real_time.restart(plan).has_value());
  const auto tick = value_of(real_time.feedback(HoppingRobot::standing()));
  EXPECT_LE(tick.step, 1e-5);  // it was not moved on
  EXPECT_EQ(real_time.restart({plan.data(), 3}).error().field, "x");
}

TEST(RealTime, NamesWhatItCannotTake) {
  HoppingRobot robot(kHorizon);
  const nonlinear::Problem problem = robot.problem();
  const auto refused = [&](const nonlinear::Measured& measured, const RealTimeSettings& settings = {}) {
    auto made = RealTime::create(problem, measured, nonlinear::open_ticks_in_process, settings);
    return made ? Error{} : made.error();
  };
  EXPECT_EQ(refused({.variables = {0, -1}}).field, "measured.variables");
  EXPECT_EQ(refused({.variables = {0, -1}}).index, 1);
  EXPECT_EQ(refused({.variables = {2, 2}}).index, 1);
  EXPECT_EQ(refused({.equalities = {0, 124}}).field, "measured.equalities");
  EXPECT_EQ(refused({.equalities = {0, 124}}).index, 1);
  const auto with = [](auto&& change) {
    RealTimeSettings settings;
    change(settings);
    return settings;
  };
  EXPECT_EQ(refused({}, with([](auto& s) { s.curvature = nonlinear::Curvature::bfgs; })).field,
            "settings.curvature");
  EXPECT_EQ(refused({}, with([](auto& s) { s.curvature = nonlinear::Curvature::exact; })).field, "hessian");
  EXPECT_EQ(refused({}, with([](auto& s) { s.radius = 0.0; })).field, "settings.radius");
  EXPECT_EQ(refused({}, with([](auto& s) { s.diagonal = -1.0; })).field, "settings.diagonal");
  EXPECT_EQ(refused({}, with([](auto& s) { s.shift.pairs = {{.first = 0, .count = 31, .by = 1}}; })).field,
            "settings.shift.pairs[0].count");
  RealTime real_time = loop_of(robot);
  const std::vector<double> few = {0.0, 0.0};
  EXPECT_EQ(real_time.feedback(few).error().field, "measurement");
  EXPECT_EQ(real_time.feedback(few).error().code, ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace marble::testing
