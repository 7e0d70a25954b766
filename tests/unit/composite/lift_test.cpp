// An answer for some scenarios as a start for more of them.
#include "composite/lift.h"

#include <gtest/gtest.h>

#include <utility>

#include "composite/random_scenarios.h"
#include "support/independent_check.h"

namespace marble {
namespace {

using testing::RandomScenarios;

// Scenarios of different rows have no plan in common, at random.
ScenarioNumbers other_cost(ScenarioNumbers scenario) {
  return {
      .c0 = scenario.c0, .g = std::move(scenario.g), .Q = std::move(scenario.Q), .weight = scenario.weight};
}

TEST(ScenarioLift, SolvesTheLargerProblemWhereItsScenariosAreTheOldOnesAgain) {
  int solved = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const RandomScenarios random(seed);
    const Stages stages = Stages::create(random.problem()).value();
    std::vector<ScenarioNumbers> scenarios = {other_cost(random.scenario(0)), other_cost(random.scenario(1))};
    const std::vector<double> weights = normalized_weights(scenarios);
    const OwnedProblem small = stages.assemble(scenarios, weights).value();
    const Solution answer = solve_in_process(small.view()).value();
    if (!is_solved(answer.status)) continue;
    ++solved;
    scenarios = {scenarios[0], scenarios[1], scenarios[0], scenarios[1]};
    const std::vector<double> halves = normalized_weights(scenarios);
    std::vector<Solution> parts;
    const Interrupt never;
    Checkpoint checkpoint(never);
    for (std::size_t s = 0; s < 4; ++s)
      parts.push_back(scenario_part(stages, answer,
                                    nearest(stages, scenarios[s], std::span(scenarios).first(2), checkpoint),
                                    weights[s % 2]));
    std::vector<const Solution*> pointers;
    for (const Solution& part : parts) pointers.push_back(&part);
    const Solution start = lifted(stages, answer, pointers, halves);
    const OwnedProblem large = stages.assemble(scenarios, halves).value();
    const testing::Verdict before = testing::judge(small.view(), answer);
    const testing::Verdict after = testing::judge(large.view(), start);
    EXPECT_LE(after.infeasibility(), before.infeasibility() + 1e-12) << seed;
    EXPECT_LE(after.absolute_stationarity, before.absolute_stationarity + 1e-10) << seed;
    EXPECT_LE(after.wrong_sign, before.wrong_sign + 1e-12) << seed;
    EXPECT_LE(after.slackness, before.slackness + 1e-10) << seed;
    EXPECT_NEAR(after.objective, before.objective, 1e-10) << seed;
    const Solution warm = solve_in_process(large.view(), {}, {.warm_start = &start}).value();
    EXPECT_EQ(warm.status, Status::solved) << seed;
    EXPECT_NEAR(warm.objective, answer.objective, 1e-8) << seed;
    EXPECT_LE(warm.factorizations, 4) << seed << " " << warm.detail;
  }
  EXPECT_GE(solved, 10);
}

TEST(ScenarioLift, TakesTheFirstOfTheNearestScenarios) {
  const RandomScenarios random(1);
  const Stages stages = Stages::create(random.problem()).value();
  const std::vector<ScenarioNumbers> scenarios = {random.scenario(4), random.scenario(7), random.scenario(7)};
  const Interrupt never;
  Checkpoint checkpoint(never);
  EXPECT_EQ(nearest(stages, random.scenario(7), scenarios, checkpoint), 1u);
  EXPECT_EQ(nearest(stages, random.scenario(4), scenarios, checkpoint), 0u);
  ScenarioNumbers base;
  base.g = random.base.g;
  const std::vector<ScenarioNumbers> with_base = {random.scenario(1), ScenarioNumbers{}};
  EXPECT_EQ(nearest(stages, base, with_base, checkpoint), 1u) << "what is absent is the base's";
}

TEST(ScenarioLift, NearestScenarioEndsWithItsCheckpoint) {
  const RandomScenarios random(1);
  const Stages stages = Stages::create(random.problem()).value();
  std::vector<ScenarioNumbers> known(20'000, random.scenario(1));
  known.back() = random.scenario(7);
  std::stop_source stop;
  stop.request_stop();
  const Interrupt stopped(stop.get_token());
  Checkpoint checkpoint(stopped);
  EXPECT_EQ(nearest(stages, random.scenario(7), known, checkpoint), 0u);
  EXPECT_TRUE(checkpoint.reached(1)) << "the next search ends at once";
}

TEST(ScenarioLift, WeightsNearTheEndsOfTheDoublesStayFinite) {
  std::vector<ScenarioNumbers> known(3);
  known[0].weight = known[1].weight = 1e308;
  known[2].weight = 5e-324;
  const std::vector<double> weights = normalized_weights(known);
  EXPECT_EQ(weights[0], 0.5);
  EXPECT_EQ(weights[1], 0.5);
  EXPECT_EQ(weights[2], 0.0);
}

}  // namespace
}  // namespace marble
