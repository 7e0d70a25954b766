// One plan for many scenarios by the C++ client: on a server and in process the same bits.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "marble/client.h"
#include "marble/scenario_examples.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

class ClientScenarios : public ::testing::Test {
 protected:
  [[nodiscard]] ScenarioProblem scenarios() const {
    return rocket_.scenarios({3.0, 4.5, 3.4, 4.1, 3.7, 4.3});
  }

  const examples::OneNumberScenarios rocket_ = examples::rocket_by_altitude();
  ServerProcess server_{MARBLE_SERVER_BINARY};
  const Client there_ = Client::connect(server_.address()).value();
  const Client here_ = Client::in_process();
};

TEST_F(ClientScenarios, HaveTheSameBitsThereAndHere) {
  std::vector<std::int64_t> reported;
  ScenarioSettings settings{.max_sample_size = 4};
  settings.stage = [&](const SampleAverageStage& stage) { reported.push_back(stage.scenarios); };
  const auto there = there_.solve_scenarios(scenarios(), settings);
  ASSERT_TRUE(there) << there.error().message();
  EXPECT_EQ(reported, (std::vector<std::int64_t>{1, 2, 4}));
  EXPECT_FALSE(there->job_id.empty());
  EXPECT_GT(there->total_s, 0.0);
  const auto here = here_.solve_scenarios(scenarios(), settings);
  ASSERT_TRUE(here) << here.error().message();
  EXPECT_EQ(there->end, here->end);
  EXPECT_EQ(there->x, here->x);
  EXPECT_EQ(there->recourse, here->recourse);
  EXPECT_EQ(there->solution.complementarity_multipliers_L, here->solution.complementarity_multipliers_L);
  ASSERT_EQ(there->stages.size(), here->stages.size());
  for (std::size_t k = 0; k < here->stages.size(); ++k)
    EXPECT_EQ(there->stages[k].out_of_sample->mean, here->stages[k].out_of_sample->mean);
}

TEST_F(ClientScenarios, MayBeDrawnThere) {
  ScenarioProblem problem = scenarios();
  problem.sample = nullptr;
  const std::vector<double> gain = {2.0};
  const ScenarioSampler sampler{.seed = 3,
                                .quantities = {{.distribution = ScenarioDistribution::normal,
                                                .effects = {{{ProblemPart::c0, {}}, gain}}}}};
  const ScenarioSettings settings{.max_sample_size = 2, .out_of_sample_scenarios = 4};
  const auto there = there_.solve_scenarios(problem, sampler, settings);
  ASSERT_TRUE(there) << there.error().message();
  const auto here = here_.solve_scenarios(problem, sampler, settings);
  ASSERT_TRUE(here) << here.error().message();
  EXPECT_EQ(there->x, here->x);
  EXPECT_EQ(there->objective, here->objective);
  EXPECT_EQ(there->stages.back().out_of_sample->half_width, here->stages.back().out_of_sample->half_width);
}

TEST_F(ClientScenarios, MayBeSubmittedAndWatched) {
  const auto job = there_.jobs().submit(scenarios(), ScenarioSettings{.max_sample_size = 4});
  ASSERT_TRUE(job) << job.error().message();
  std::vector<SampleAverageStage> stages;
  const auto watched =
      there_.jobs().watch(job->job_id, [&](const JobEvent& event) { stages = event.job.stages; });
  ASSERT_TRUE(watched) << watched.error().message();
  ASSERT_EQ(stages.size(), 3u);
  const auto answer = there_.jobs().scenarios(job->job_id, {.wait = true});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_EQ(answer->scenarios, 4);
  EXPECT_EQ(answer->objective, stages.back().objective);
  const OwnedProblem base = rocket_.base;
  const auto plain = there_.jobs().submit(base.view());
  ASSERT_TRUE(plain);
  const auto none = there_.jobs().scenarios(plain->job_id, {.wait = true});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::failed_precondition);
}

TEST_F(ClientScenarios, NameWhatIsWrongWithThem) {
  ScenarioProblem problem = scenarios();
  problem.first_stage = {};
  const auto refused = there_.solve_scenarios(problem);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::invalid_argument);
  EXPECT_NE(refused.error().field.find("first_stage"), std::string::npos) << refused.error().field;
  problem = scenarios();
  problem.sample = [](std::int64_t i) -> Expected<ScenarioNumbers> {
    return ScenarioNumbers{.g = std::vector<double>(i == 1 ? 3 : 0)};
  };
  const auto bad = there_.solve_scenarios(problem);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().field, "scenario[1].g");
}

TEST_F(ClientScenarios, AreGivenUpByTheStopToken) {
  std::stop_source source;
  source.request_stop();
  for (const Client* client : {&there_, &here_}) {
    const auto given_up = client->solve_scenarios(scenarios(), {}, {.stop = source.get_token()});
    ASSERT_FALSE(given_up);
    EXPECT_EQ(given_up.error().code, ErrorCode::cancelled);
  }
}

}  // namespace
}  // namespace marble::testing
