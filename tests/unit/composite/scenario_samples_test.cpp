// Scenarios as tables and as random numbers.
#include "marble/composite/scenario_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "composite/random_scenarios.h"

namespace marble {
namespace {

std::pair<double, double> mean_and_deviation(const ScenarioQuantity& quantity) {
  constexpr int kDraws = 20'000;
  double sum = 0.0, squares = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double number = scenario_draw(quantity, 5, i, 3);
    sum += number;
    squares += number * number;
  }
  const double mean = sum / kDraws;
  return {mean, std::sqrt(squares / kDraws - mean * mean)};
}

TEST(Scenarios, AreDrawnFromTheNamedDistribution) {
  using enum ScenarioDistribution;
  const auto [uniform_mean, uniform_deviation] =
      mean_and_deviation({.distribution = uniform, .location = 2.0, .scale = 6.0});
  EXPECT_NEAR(uniform_mean, 5.0, 0.05);
  EXPECT_NEAR(uniform_deviation, 6.0 / std::sqrt(12.0), 0.05);
  const auto [normal_mean, normal_deviation] =
      mean_and_deviation({.distribution = normal, .location = -1.0, .scale = 2.0});
  EXPECT_NEAR(normal_mean, -1.0, 0.06);
  EXPECT_NEAR(normal_deviation, 2.0, 0.06);
  const auto [log_mean, log_deviation] =
      mean_and_deviation({.distribution = lognormal, .location = 0.0, .scale = 0.5});
  EXPECT_NEAR(log_mean, std::exp(0.125), 0.02);
  EXPECT_NEAR(log_deviation, std::exp(0.125) * std::sqrt(std::exp(0.25) - 1.0), 0.03);
}

TEST(Scenarios, AreClippedToTheirLimits) {
  const ScenarioQuantity clipped{.distribution = ScenarioDistribution::normal, .least = -0.5, .most = 0.25};
  double least = 1.0, most = -1.0;
  for (int i = 0; i < 200; ++i) {
    const double number = scenario_draw(clipped, 1, i, 0);
    least = std::min(least, number);
    most = std::max(most, number);
  }
  EXPECT_EQ(least, -0.5);
  EXPECT_EQ(most, 0.25);
}

TEST(Scenarios, AreFunctionsOfSeedNumberAndPlaceAlone) {
  const ScenarioQuantity quantity{.distribution = ScenarioDistribution::normal};
  const double number = scenario_draw(quantity, 7, 3, 1);
  EXPECT_EQ(scenario_draw(quantity, 7, 3, 1), number);
  EXPECT_NE(scenario_draw(quantity, 8, 3, 1), number);
  EXPECT_NE(scenario_draw(quantity, 7, 4, 1), number);
  EXPECT_NE(scenario_draw(quantity, 7, 3, 2), number);
}

TEST(Scenarios, OfASamplerAreTheBasePlusGainsTimesTheNumber) {
  const testing::RandomScenarios random(3);
  ScenarioProblem problem = random.problem();
  Index row = 0;
  while (random.pair_of_plan(row)) ++row;
  const std::vector<Index> places = {row};
  const std::vector<double> one = {2.0}, cost = {-1.0};
  const ScenarioSampler sampler{
      .seed = 9,
      .quantities = {{.effects = {{{ProblemPart::l, places}, one}, {{ProblemPart::c0, {}}, cost}}},
                     {.effects = {{{ProblemPart::c0, {}}, one}}}}};
  const auto set = set_scenarios(problem, sampler);
  ASSERT_TRUE(set) << set.error().message();
  const ScenarioNumbers scenario = problem.sample(4).value();
  const double first = scenario_draw(sampler.quantities[0], 9, 4, 0);
  const double second = scenario_draw(sampler.quantities[1], 9, 4, 1);
  ASSERT_EQ(scenario.l.size(), random.base.l.size());
  EXPECT_EQ(scenario.l[row], random.base.l[row] + 2.0 * first);
  EXPECT_EQ(scenario.c0.value(), random.base.c0 - first + 2.0 * second);
  EXPECT_TRUE(scenario.g.empty()) << "what no quantity moves stays as the base has it";
}

TEST(Scenarios, OfATableAreItsRows) {
  const testing::RandomScenarios random(4);
  ScenarioProblem problem = random.problem();
  const std::vector<Index> places = {1, 3};
  const std::vector<double> values = {10.0, 30.0, 5.0, 11.0, 31.0, 6.0}, weights = {1.0, 2.0};
  const auto set = set_scenarios(
      problem,
      {.entries = {{ProblemPart::g, places}, {ProblemPart::c0, {}}}, .values = values, .weights = weights});
  ASSERT_TRUE(set) << set.error().message();
  EXPECT_EQ(problem.scenarios, 2);
  const ScenarioNumbers scenario = problem.sample(1).value();
  EXPECT_EQ(scenario.g[1], 11.0);
  EXPECT_EQ(scenario.g[3], 31.0);
  EXPECT_EQ(scenario.g[0], random.base.g[0]);
  EXPECT_EQ(scenario.c0.value(), 6.0);
  EXPECT_EQ(scenario.weight, 2.0);
}

TEST(Scenarios, MayNotChangeRowsOfThePlanAloneThatNoListNames) {
  OwnedProblem base;
  base.g = {1.0, 1.0};
  base.C = compress(2, 2, {{0, 1}, {0, 1}, {1.0, 1.0}}, "C").value();
  base.d = {0.0, 0.0};
  const std::vector<double> values = {1.0, 1.0};
  const auto field = [&](ProblemPart part, std::vector<Index> places, std::vector<Index> own) {
    ScenarioProblem problem;
    problem.base = base.view();
    problem.first_stage = {0};
    problem.own_inequalities = std::move(own);
    const auto set = set_scenarios(problem, {.entries = {{part, places}}, .values = values});
    return set ? std::string("nothing") : set.error().field + std::to_string(set.error().index);
  };
  EXPECT_EQ(field(ProblemPart::d, {}, {}), "samples.entries[0].positions0");
  EXPECT_EQ(field(ProblemPart::d, {1}, {}), "nothing");
  EXPECT_EQ(field(ProblemPart::d, {}, {0}), "nothing");
  EXPECT_EQ(field(ProblemPart::C, {0, 1}, {}), "samples.entries[0].positions0");
  EXPECT_EQ(field(ProblemPart::C, {1}, {}), "nothing");
  EXPECT_EQ(field(ProblemPart::g, {}, {}), "nothing");
  EXPECT_EQ(field(ProblemPart::b, {}, {}), "samples.entries[0].part-1");
  EXPECT_EQ(field(ProblemPart::d, {1, 1}, {}), "samples.entries[0].positions1");
}

TEST(Scenarios, ReportTheirStagesProgressAsOfOneSolve) {
  class Rows final : public ProgressSink {
   public:
    void report(const Progress& row) override { rows.push_back(without_vectors(row)); }
    std::vector<Progress> rows;
  } sink;
  const testing::RandomScenarios random(3);
  ScenarioProblem problem = random.problem();
  problem.sample = [&](std::int64_t i) -> Expected<ScenarioNumbers> {
    return ScenarioNumbers{.g = random.scenario(i).g};
  };
  const auto answer = solve_scenarios(problem, {.max_sample_size = 8}, {.progress = &sink});
  ASSERT_TRUE(answer) << answer.error().message();
  ASSERT_FALSE(sink.rows.empty());
  for (std::size_t i = 1; i < sink.rows.size(); ++i) {
    EXPECT_GE(sink.rows[i].iteration, sink.rows[i - 1].iteration);
    EXPECT_GE(sink.rows[i].factorizations, sink.rows[i - 1].factorizations);
    EXPECT_GE(sink.rows[i].stage, sink.rows[i - 1].stage);
  }
  EXPECT_EQ(sink.rows.front().scenarios, 1);
  EXPECT_LE(sink.rows.back().factorizations, answer->solution.factorizations);
  ASSERT_FALSE(answer->solution.z.empty());
  EXPECT_TRUE(std::equal(answer->x.begin(), answer->x.end(), answer->solution.z.begin()));
}

}  // namespace
}  // namespace marble
