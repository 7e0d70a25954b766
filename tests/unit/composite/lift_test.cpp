#include "composite/lift.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <utility>

#include "composite/random_scenarios.h"
#include "marble/composite/lifted_block.h"
#include "marble/solver.h"
#include "support/coupled_problems.h"
#include "support/dense_algebra.h"
#include "support/independent_check.h"

namespace marble {
namespace {

// An answer for some scenarios as a start for more of them.
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

// A block as the coordinator sees it: how its answers move with coupling_multipliers, and which sides its
// pairs keep.
constexpr testing::CoupledSizes kSizes{.blocks = 1, .variables = 6, .pairs = 3, .rows = 3};
constexpr double kHeld = 2.0;  // ρ

BlockAsk at_price(std::vector<double> price) {
  return {.price = std::move(price), .centre = {0.1, -0.2, 0.3}, .proximal = kHeld, .switched_pairs = {}};
}

Solution near(const LiftedBlock& block, const Solution* start) {
  Options options;
  if (start != nullptr) options.max_local_search_factorizations = 0;
  Solver solver = Solver::create(Problem::create(block.problem().view()).value(), options).value();
  SolveControls controls;
  controls.warm_start = start;
  return solver.solve(controls).value();
}

TEST(LiftedBlock, ItsResponseToPricesIsThatOfItsAnswersNearby) {
  constexpr double kStep = 1e-5;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const testing::OwnedCoupled coupled = testing::random_coupled(kSizes, seed);
    const CoupledView view = coupled.view();
    LiftedBlock block(view.blocks[0]);
    block.ask(at_price({0.5, -0.5, 0.2}));
    const Solution answer = near(block, nullptr);
    ASSERT_TRUE(is_solved(answer.status));
    const std::vector<double> response = LiftedResponse().at(block, block.update(), answer).value();
    ASSERT_EQ(response.size(), 9U);
    for (std::size_t j = 0; j < 3; ++j) {
      std::vector<double> price = {0.5, -0.5, 0.2};
      price[j] += kStep;
      block.ask(at_price(price));
      const Solution moved = near(block, &answer);
      for (std::size_t i = 0; i < 3; ++i)
        EXPECT_NEAR(response[3 * j + i], -(moved.z[6 + i] - answer.z[6 + i]) / kStep, 1e-4) << seed;
    }
  }
}

TEST(LiftedBlock, WithoutItsProximalTermItRespondsByTheInverseSum) {
  const Eigen::Matrix3d root{{1.0, 0.2, 0.0}, {-0.3, 0.8, 0.1}, {0.4, 0.0, 0.6}};
  const Eigen::Matrix3d own = root * root.transpose();
  // T = (S⁻¹ + ρI)⁻¹ = S (I + ρS)⁻¹
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d held;
  for (Eigen::Index j = 0; j < 3; ++j) held.col(j) = testing::dense_solve(identity + kHeld * own, own.col(j));
  const std::vector<double> back =
      without_proximal(std::vector<double>(held.data(), held.data() + 9), 3, kHeld);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(back[i], own.data()[i], 1e-12);
}

TEST(LiftedBlock, FrozenItHasTheSameAnswerAndAFlipHoldsTheOtherSide) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const testing::OwnedCoupled coupled = testing::random_coupled(kSizes, seed);
    const CoupledView view = coupled.view();
    LiftedBlock block(view.blocks[0]);
    block.ask(at_price({0.0, 0.0, 0.0}));
    const Solution free = near(block, nullptr);
    ASSERT_TRUE(is_solved(free.status));
    const Solution start = block.freeze(free);
    EXPECT_TRUE(block.problem().l.empty());
    const Solution frozen = near(block, &start);
    const BlockAnswer same = block.answer(frozen, {});
    ASSERT_TRUE(is_solved(same.status));
    for (std::size_t j = 0; j < 6; ++j) EXPECT_NEAR(same.solution.z[j], free.z[j], 1e-8) << seed;

    const auto sides = [&](const std::vector<double>& z) {
      double s = coupled.blocks[0].l[0], t = coupled.blocks[0].r[0];
      for (Index j = 0; j < 6; ++j) {
        const SparseMatrix &L = coupled.blocks[0].L, &R = coupled.blocks[0].R;
        s += L.values[static_cast<std::size_t>(3 * j)] * z[static_cast<std::size_t>(j)];
        t += R.values[static_cast<std::size_t>(3 * j)] * z[static_cast<std::size_t>(j)];
      }
      return std::pair(s, t);
    };
    const auto [s, t] = sides(same.solution.z);
    block.switch_pair(0);
    static_cast<void>(block.update());
    const Solution switched = near(block, nullptr);
    ASSERT_TRUE(is_solved(switched.status));
    const auto [s_after, t_after] = sides(block.answer(switched, {}).solution.z);
    EXPECT_NEAR(s < t ? t_after : s_after, 0.0, 1e-7) << seed;
    EXPECT_GE(s < t ? s_after : t_after, -1e-7) << seed;
  }
}

}  // namespace
}  // namespace marble
