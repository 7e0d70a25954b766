// Scenario solves: stages of more and more scenarios.
#include "marble/composite/scenarios.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "composite/random_scenarios.h"
#include "composite/stages.h"
#include "marble/scenario_examples.h"
#include "support/independent_check.h"

namespace marble {
namespace {

using examples::OneNumberScenarios;

std::vector<double> altitudes(int scenarios) {
  std::vector<double> result;
  for (int j = 0; j < scenarios; ++j) result.push_back(3.0 + 1.8 * (j + 0.5) / scenarios);
  return result;
}

// Far apart first: scenario i of the sequence is where the i-th binary fraction lies between low and high.
std::vector<double> spread(int scenarios, double low, double high) {
  std::vector<double> result;
  for (int i = 0; i < scenarios; ++i) {
    double fraction = 0.0, digit = 0.5;
    for (int rest = i + 1; rest > 0; rest /= 2, digit /= 2) fraction += digit * (rest % 2);
    result.push_back(low + (high - low) * fraction);
  }
  return result;
}

class ThreadPerBatch final : public TaskRunner {
 public:
  void run(std::span<const std::function<void()>> tasks) override {
    std::vector<std::thread> threads;
    for (auto task = tasks.rbegin(); task != tasks.rend(); ++task) threads.emplace_back(*task);
    for (std::thread& thread : threads) thread.join();
    most = std::max(most, tasks.size());
  }
  std::size_t most = 0;
};

TEST(Scenarios, HaveThePublishedRocketsOptima) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  const std::pair<int, double> table[] = {{1, 380.714796}, {2, 383.220179}, {4, 386.141364}};
  for (const auto& [scenarios, optimum] : table) {
    const auto answer = solve_scenarios(rocket.scenarios(altitudes(scenarios)),
                                        {.initial_sample_size = scenarios, .max_sample_size = scenarios});
    ASSERT_TRUE(answer) << answer.error().message();
    EXPECT_EQ(answer->end, ScenarioEnd::samples);
    EXPECT_NEAR(answer->objective, optimum, 1e-6 * optimum) << scenarios;
  }
  const auto high = solve_scenarios(rocket.scenarios({4.8}));
  EXPECT_NEAR(high.value().objective, 385.7827, 1e-4);
}

TEST(Scenarios, GrowToAnAnswerThatSolvesTheProblemOfAllScenarios) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  const ScenarioProblem problem = rocket.scenarios(spread(8, 3.0, 4.8));
  std::vector<std::int64_t> reported;
  const auto grown =
      solve_scenarios(problem, {.max_sample_size = 8, .stage = [&](const SampleAverageStage& stage) {
                                  reported.push_back(stage.scenarios);
                                  EXPECT_EQ(stage.x.size(), rocket.first_stage.size());
                                }});
  ASSERT_TRUE(grown) << grown.error().message();
  EXPECT_EQ(reported, (std::vector<std::int64_t>{1, 2, 4, 8}));
  EXPECT_EQ(grown->end, ScenarioEnd::samples);
  EXPECT_EQ(grown->status, Status::solved);
  EXPECT_EQ(grown->scenarios, 8);
  EXPECT_FALSE(grown->stages.back().out_of_sample) << "there are no scenarios but these";
  EXPECT_EQ(grown->stages[1].out_of_sample.value().scenarios, 6);
  const OwnedProblem whole = assemble_scenarios(problem, 8).value();
  Solution together;
  together.z = grown->x;
  for (const std::vector<double>& y : grown->recourse)
    together.z.insert(together.z.end(), y.begin(), y.end());
  Solution cold = solve_in_process(whole.view()).value();
  EXPECT_LE(grown->objective, cold.objective * 1.02);
  cold.z = together.z;
  const testing::Verdict verdict = testing::judge(whole.view(), cold);
  EXPECT_LE(verdict.infeasibility(), 1e-6);
  EXPECT_NEAR(verdict.objective, grown->objective, 1e-8 * grown->objective);
}

TEST(Scenarios, NameTheScenarioThatHasNoPlan) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  const auto alone = solve_scenarios(rocket.scenarios({5.138}));
  ASSERT_TRUE(alone) << alone.error().message();
  EXPECT_EQ(alone->end, ScenarioEnd::not_solved);
  EXPECT_EQ(alone->infeasible, std::vector<std::int64_t>{0});
  EXPECT_TRUE(alone->x.empty());
  const auto among = solve_scenarios(rocket.scenarios({3.9, 4.2, 5.392, 4.0}));
  ASSERT_TRUE(among) << among.error().message();
  EXPECT_EQ(among->end, ScenarioEnd::not_solved);
  EXPECT_EQ(among->infeasible, std::vector<std::int64_t>{2});
  EXPECT_NE(among->detail.find("scenario 2"), std::string::npos) << among->detail;
  EXPECT_FALSE(is_solved(among->status));
  EXPECT_EQ(among->scenarios, 2) << "the plan of the stage before stays";
  EXPECT_EQ(among->x.size(), rocket.first_stage.size());
  EXPECT_EQ(among->recourse.size(), 2u);
}

TEST(Scenarios, GiveTheSameBitsWhoeverHelps) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  const ScenarioProblem problem = rocket.scenarios(spread(24, 3.0, 4.8));
  const ScenarioSettings settings{.max_sample_size = 4};
  const ScenarioSolution alone = solve_scenarios(problem, settings).value();
  ThreadPerBatch threads;
  const ScenarioSolution helped = solve_scenarios(problem, settings, {.runner = &threads}).value();
  EXPECT_GT(threads.most, 1u);
  EXPECT_EQ(helped.x, alone.x);
  EXPECT_EQ(helped.recourse, alone.recourse);
  EXPECT_EQ(helped.objective, alone.objective);
  ASSERT_EQ(helped.stages.size(), alone.stages.size());
  for (std::size_t k = 0; k < alone.stages.size(); ++k) {
    EXPECT_EQ(helped.stages[k].factorizations, alone.stages[k].factorizations);
    EXPECT_EQ(helped.stages[k].out_of_sample->mean, alone.stages[k].out_of_sample->mean);
    EXPECT_EQ(helped.stages[k].out_of_sample->half_width, alone.stages[k].out_of_sample->half_width);
    EXPECT_EQ(helped.stages[k].out_of_sample->factorizations, alone.stages[k].out_of_sample->factorizations);
  }
}

TEST(Scenarios, AreNestedAndAskedForInOrder) {
  const testing::RandomScenarios random(3);
  ScenarioProblem problem = random.problem();
  std::vector<std::int64_t> asked;
  problem.sample = [&](std::int64_t i) -> Expected<ScenarioNumbers> {
    asked.push_back(i);
    ScenarioNumbers numbers;
    numbers.g = random.scenario(i).g;
    return numbers;
  };
  const auto answer = solve_scenarios(
      problem, {.initial_sample_size = 2, .growth = 1.5, .max_sample_size = 7, .out_of_sample_scenarios = 3});
  ASSERT_TRUE(answer) << answer.error().message();
  std::vector<std::int64_t> stages;
  for (const SampleAverageStage& stage : answer->stages) stages.push_back(stage.scenarios);
  EXPECT_EQ(stages, (std::vector<std::int64_t>{2, 3, 5, 7}));
  ASSERT_EQ(asked.size(), 10u) << "3 fresh ones after the last stage";
  for (std::size_t i = 0; i < asked.size(); ++i) EXPECT_EQ(asked[i], static_cast<std::int64_t>(i));
}

// One number: min (x − ξ)² in the mean, by a recourse y = x − ξ.
struct Target {
  Target() {
    base.g = {0.0, 0.0};
    base.Q = {2, 2, {0, 0, 1}, {1}, {2.0}};
    base.A = {1, 2, {0, 1, 2}, {0, 0}, {1.0, -1.0}};
    base.b = {0.0};
    base.hessian_form = HessianForm::upper_triangle;
  }
  [[nodiscard]] ScenarioProblem problem(std::vector<double> numbers) const {
    ScenarioProblem result;
    result.base = base.view();
    result.first_stage = {0};
    result.scenarios = static_cast<std::int64_t>(numbers.size());
    result.sample = [numbers](std::int64_t i) -> Expected<ScenarioNumbers> {
      ScenarioNumbers scenario;
      scenario.b = {-numbers[static_cast<std::size_t>(i)]};
      return scenario;
    };
    return result;
  }
  OwnedProblem base;
};

TEST(Scenarios, ReportTheMeanOfScenariosNotSeenAndItsInterval) {
  const Target target;
  const auto answer =
      solve_scenarios(target.problem({1.0, 3.0, 0.0, 4.0, 8.0, 2.0}),
                      {.initial_sample_size = 2, .max_sample_size = 2, .out_of_sample_scenarios = 4});
  ASSERT_TRUE(answer) << answer.error().message();
  ASSERT_EQ(answer->x.size(), 1u);
  EXPECT_NEAR(answer->x[0], 2.0, 1e-9);
  EXPECT_NEAR(answer->objective, 1.0, 1e-9);
  // Costs 4, 4, 36, 0: mean 11, sum of squares 49 + 49 + 625 + 121, over 3 and over 4.
  const OutOfSample& out_of_sample = answer->stages.front().out_of_sample.value();
  EXPECT_EQ(out_of_sample.scenarios, 4);
  EXPECT_EQ(out_of_sample.infeasible, 0);
  EXPECT_NEAR(out_of_sample.mean, 11.0, 1e-8);
  EXPECT_NEAR(out_of_sample.half_width, 1.959963984540054 * std::sqrt(844.0 / 12.0), 1e-7);
}

TEST(Scenarios, WeighScenariosAsTheySay) {
  const Target target;
  ScenarioProblem problem = target.problem({0.0, 4.0});
  problem.sample = [](std::int64_t i) -> Expected<ScenarioNumbers> {
    ScenarioNumbers scenario;
    scenario.b = {i == 0 ? 0.0 : -4.0};
    scenario.weight = i == 0 ? 3.0 : 1.0;
    return scenario;
  };
  const auto answer = solve_scenarios(problem, {.max_sample_size = 2});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_NEAR(answer->x[0], 1.0, 1e-9);
  EXPECT_NEAR(answer->objective, 0.75 * 1.0 + 0.25 * 9.0, 1e-9);
}

TEST(Scenarios, EndWhenTheIntervalIsSmallEnough) {
  const Target target;
  std::vector<double> numbers;
  for (int i = 0; i < 256; ++i) numbers.push_back(i % 2 == 0 ? 10.0 : -10.0);
  const auto answer = solve_scenarios(
      target.problem(numbers),
      {.initial_sample_size = 2, .max_sample_size = 256, .tolerance = 0.01, .min_sample_size = 2});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_EQ(answer->end, ScenarioEnd::interval);
  EXPECT_EQ(answer->scenarios, 2) << "every scenario costs the same";
  const auto later = solve_scenarios(target.problem(numbers), {.max_sample_size = 256, .tolerance = 0.01});
  EXPECT_EQ(later.value().scenarios, 8) << "few scenarios may agree by chance";
  const auto never = solve_scenarios(target.problem(numbers),
                                     {.initial_sample_size = 2, .max_sample_size = 8, .tolerance = 0.0});
  EXPECT_EQ(never.value().end, ScenarioEnd::samples);
}

// x ≥ ξ by a recourse y = x − ξ ≥ 0: a larger scenario has no recourse.
TEST(Scenarios, CountInfeasibleScenariosAndDoNotEndOnThem) {
  Target target;
  target.base.C = {1, 2, {0, 0, 1}, {0}, {1.0}};
  target.base.d = {0.0};
  const auto answer = solve_scenarios(
      target.problem({1.0, 0.5, 2.0, 0.0}),
      {.initial_sample_size = 1, .max_sample_size = 4, .tolerance = 1e9, .min_sample_size = 1});
  ASSERT_TRUE(answer) << answer.error().message();
  ASSERT_EQ(answer->stages.size(), 3u);
  EXPECT_EQ(answer->stages[0].out_of_sample.value().scenarios, 3);
  EXPECT_EQ(answer->stages[0].out_of_sample.value().infeasible, 1);
  EXPECT_EQ(answer->end, ScenarioEnd::samples);
  EXPECT_NEAR(answer->x[0], 2.0, 1e-9);
}

TEST(Scenarios, KeepTheNewestPlanWhenTheyAreStopped) {
  const Target target;
  std::stop_source source;
  const auto stopped = solve_scenarios(target.problem({1.0, 2.0, 3.0, 4.0}),
                                       {.stage =
                                            [&](const SampleAverageStage& stage) {
                                              if (stage.scenarios == 2) source.request_stop();
                                            }},
                                       {.stop = source.get_token()});
  ASSERT_TRUE(stopped) << stopped.error().message();
  EXPECT_EQ(stopped->end, ScenarioEnd::cancelled);
  EXPECT_EQ(stopped->scenarios, 2);
  EXPECT_NEAR(stopped->x.at(0), 1.5, 1e-9);
  ScenarioSettings at_once;
  at_once.options.time_limit_s = 0.0;
  const auto late = solve_scenarios(target.problem({1.0, 2.0}), at_once);
  ASSERT_TRUE(late) << late.error().message();
  EXPECT_EQ(late->end, ScenarioEnd::time_limit);
  EXPECT_EQ(late->scenarios, 0);
}

TEST(Scenarios, EndWhereTheNextStageIsTooLarge) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  const ScenarioProblem problem = rocket.scenarios(spread(64, 3.0, 4.8));
  const auto answer = solve_scenarios(problem, {.max_sample_size = 64}, {}, {.most_bytes = 20'000'000});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_EQ(answer->end, ScenarioEnd::too_large);
  EXPECT_GE(answer->scenarios, 1);
  const auto none = solve_scenarios(problem, {.max_sample_size = 64}, {}, {.most_bytes = 1'000'000});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::resource_exhausted);
}

TEST(Scenarios, InitialSampleThatDoesNotFitIsRefusedBeforeItsScenariosAreDrawn) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  ScenarioProblem problem = rocket.scenarios(spread(64, 3.0, 4.8));
  problem.scenarios = 1'000'000;
  std::int64_t drawn = 0;
  problem.sample = [sample = problem.sample, &drawn](std::int64_t i) {
    ++drawn;
    return sample(i % 64);
  };
  const ScenarioSettings settings{.initial_sample_size = 1'000'000, .max_sample_size = 1'000'000};
  const auto none = solve_scenarios(problem, settings, {}, {.most_bytes = 100'000'000});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(none.error().field, "scenarios");
  EXPECT_EQ(drawn, 1);
  const auto refused = check_initial_sample(problem, settings, 100'000'000);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "settings.initial_sample_size");
  EXPECT_TRUE(check_initial_sample(problem, {}, 100'000'000));
}

TEST(Scenarios, StageThatDoesNotFitLeavesTheAnswerOfTheStageBefore) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  ScenarioProblem problem = rocket.scenarios(spread(64, 3.0, 4.8));
  problem.scenarios = 1'000'000;
  std::int64_t drawn = 0;
  problem.sample = [sample = problem.sample, &drawn](std::int64_t i) {
    ++drawn;
    return sample(i % 64);
  };
  const auto answer = solve_scenarios(problem, {.growth = 1e6, .max_sample_size = 1'000'000}, {},
                                      {.most_bytes = 100'000'000});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_EQ(answer->end, ScenarioEnd::too_large);
  EXPECT_EQ(answer->status, Status::solved);
  EXPECT_EQ(answer->scenarios, 1);
  EXPECT_LE(drawn, 100) << "none for a stage that is not built";
}

TEST(Scenarios, DrawingEndsWithTheStopToken) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  ScenarioProblem problem = rocket.scenarios(spread(64, 3.0, 4.8));
  problem.scenarios = 10'000;
  std::stop_source stop;
  problem.sample = [sample = problem.sample, &stop](std::int64_t i) {
    if (i == 5) stop.request_stop();
    EXPECT_LE(i, 5);
    return sample(i % 64);
  };
  const auto answer = solve_scenarios(problem, {.initial_sample_size = 10'000, .max_sample_size = 10'000},
                                      {.stop = stop.get_token()});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_EQ(answer->end, ScenarioEnd::cancelled);
  EXPECT_EQ(answer->scenarios, 0);
}

TEST(Scenarios, TakeMemoryInProportionToTheirNumber) {
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  const ScenarioProblem problem = rocket.scenarios(spread(256, 3.0, 4.8));
  const auto bytes = [&](int scenarios) {
    const OwnedProblem whole = assemble_scenarios(problem, scenarios).value();
    return static_cast<double>(Solver::create(Problem::create(whole.view()).value()).value().memory_bytes());
  };
  const double few = bytes(64), more = bytes(128), many = bytes(256);
  EXPECT_LE(many - more, 2.2 * (more - few)) << few << " " << more << " " << many;
}

TEST(Scenarios, RefuseSettingsOutOfRange) {
  const Target target;
  const ScenarioProblem problem = target.problem({1.0, 2.0});
  const auto field = [&](const ScenarioSettings& settings) {
    const auto refused = solve_scenarios(problem, settings);
    return refused ? std::string("nothing") : refused.error().field;
  };
  EXPECT_EQ(field({.initial_sample_size = 0}), "settings.initial_sample_size");
  EXPECT_EQ(field({.growth = 1.0}), "settings.growth");
  EXPECT_EQ(field({.initial_sample_size = 3, .max_sample_size = 2}), "settings.max_sample_size");
  EXPECT_EQ(field({.tolerance = -1.0}), "settings.tolerance");
  EXPECT_EQ(field({.min_sample_size = 0}), "settings.min_sample_size");
  EXPECT_EQ(field({.max_infeasible_fraction = 2.0}), "settings.max_infeasible_fraction");
  EXPECT_EQ(field({.out_of_sample_scenarios = -1}), "settings.out_of_sample_scenarios");
  ScenarioSettings bad;
  bad.options.num_starts = 0;
  EXPECT_EQ(field(bad), "settings.options.num_starts");
}

TEST(Scenarios, PlanAHopperForGroundsOfDifferentFriction) {
  const OneNumberScenarios hopper = examples::hopper_by_friction({.steps = 6});
  const auto answer = solve_scenarios(hopper.scenarios(spread(4, 0.5, 1.0)), {.max_sample_size = 4});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_EQ(answer->end, ScenarioEnd::samples) << answer->detail;
  EXPECT_EQ(answer->status, Status::solved);
  EXPECT_LE(answer->violations.complementarity, 1e-6);
}

}  // namespace
}  // namespace marble
