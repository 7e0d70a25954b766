// An answer for some worlds as a start for more of them.
#include "scenarios/lift.h"

#include <gtest/gtest.h>

#include <utility>

#include "scenarios/random_worlds.h"
#include "support/judges/independent_check.h"

namespace marble {
namespace {

using testing::RandomWorlds;

// Worlds of different rows have no plan in common, at random.
ScenarioNumbers other_cost(ScenarioNumbers world) {
  return {.c0 = world.c0, .g = std::move(world.g), .Q = std::move(world.Q), .weight = world.weight};
}

TEST(ScenarioLift, SolvesTheLargerProblemWhereItsWorldsAreTheOldOnesAgain) {
  int solved = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const RandomWorlds random(seed);
    const Stages stages = Stages::create(random.problem()).value();
    std::vector<ScenarioNumbers> worlds = {other_cost(random.world(0)), other_cost(random.world(1))};
    const std::vector<double> weights = normalized_weights(worlds);
    const OwnedProblem small = stages.assemble(worlds, weights).value();
    const Solution answer = solve_in_process(small.view()).value();
    if (!is_solved(answer.status)) continue;
    ++solved;
    worlds = {worlds[0], worlds[1], worlds[0], worlds[1]};
    const std::vector<double> halves = normalized_weights(worlds);
    std::vector<Solution> parts;
    const Interrupt never;
    Checkpoint checkpoint(never);
    for (std::size_t s = 0; s < 4; ++s)
      parts.push_back(world_part(stages, answer,
                                 nearest(stages, worlds[s], std::span(worlds).first(2), checkpoint),
                                 weights[s % 2]));
    std::vector<const Solution*> pointers;
    for (const Solution& part : parts) pointers.push_back(&part);
    const Solution start = lifted(stages, answer, pointers, halves);
    const OwnedProblem large = stages.assemble(worlds, halves).value();
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

TEST(ScenarioLift, TakesTheFirstOfTheNearestWorlds) {
  const RandomWorlds random(1);
  const Stages stages = Stages::create(random.problem()).value();
  const std::vector<ScenarioNumbers> worlds = {random.world(4), random.world(7), random.world(7)};
  const Interrupt never;
  Checkpoint checkpoint(never);
  EXPECT_EQ(nearest(stages, random.world(7), worlds, checkpoint), 1u);
  EXPECT_EQ(nearest(stages, random.world(4), worlds, checkpoint), 0u);
  ScenarioNumbers base;
  base.g = random.base.g;
  const std::vector<ScenarioNumbers> with_base = {random.world(1), ScenarioNumbers{}};
  EXPECT_EQ(nearest(stages, base, with_base, checkpoint), 1u) << "what is absent is the base's";
}

TEST(ScenarioLift, NearestScenarioEndsWithItsCheckpoint) {
  const RandomWorlds random(1);
  const Stages stages = Stages::create(random.problem()).value();
  std::vector<ScenarioNumbers> known(20'000, random.world(1));
  known.back() = random.world(7);
  std::stop_source stop;
  stop.request_stop();
  const Interrupt stopped(stop.get_token());
  Checkpoint checkpoint(stopped);
  EXPECT_EQ(nearest(stages, random.world(7), known, checkpoint), 0u);
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
