#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/client.h"
#include "marble/examples.h"
#include "marble/scenario_examples.h"
#include "support/coupled_problems.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

// One plan for many scenarios by the C++ client: on a server and in process the same bits.
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

// Coupled problems whose blocks are sessions of several servers, with this process as their coordinator.
class CoupledSessions : public ::testing::Test {
 protected:
  static constexpr int kServers = 3;

  void SetUp() override {
    for (std::size_t k = 0; k < cell_.blocks.size(); ++k) cell_.blocks[k].name = "arm" + std::to_string(k);
  }

  void start(const std::vector<std::string>& flags = {}) {
    for (int i = 0; i < kServers; ++i) {
      servers_.push_back(std::make_unique<ServerProcess>(MARBLE_SERVER_BINARY, flags));
      address_ += (i == 0 ? "" : ",") + servers_.back()->address();
      single_.push_back(Client::connect(servers_.back()->address()).value());
    }
  }

  void expect_the_answer_of_this_process(const CoupledSolution& answer) const {
    const CoupledSolution here = solve_coupled(cell_.view()).value();
    ASSERT_TRUE(is_solved(answer.monolithic.status)) << answer.monolithic.detail;
    EXPECT_EQ(answer.coordination.status, here.coordination.status);
    EXPECT_NEAR(answer.monolithic.objective, here.monolithic.objective,
                1e-9 * (1.0 + std::abs(here.monolithic.objective)));
    ASSERT_EQ(answer.monolithic.z.size(), here.monolithic.z.size());
    for (std::size_t i = 0; i < here.monolithic.z.size(); ++i)
      EXPECT_NEAR(answer.monolithic.z[i], here.monolithic.z[i], 1e-7) << i;
  }

  OwnedCoupled cell_ = random_coupled({.blocks = 6, .variables = 8, .pairs = 3, .rows = 4}, 7);
  std::vector<std::unique_ptr<ServerProcess>> servers_;
  std::vector<Client> single_;
  std::string address_;
};

TEST_F(CoupledSessions, AreDealtToAllServersAndNoServerSeesABlockOfAnother) {
  start();
  const Client client = Client::connect(address_).value();
  const RemoteCoupledSolution answer =
      client.solve_coupled_by_sessions(cell_.view(), {}, {}, {.problem_name = "cell"}).value();
  expect_the_answer_of_this_process(answer);
  EXPECT_EQ(answer.repeated, 0);
  std::multiset<std::string> all;
  for (const Client& server : single_) {
    std::set<std::string> seen;
    const JobPage page = server.jobs().list().value();
    for (const JobInfo& job : page.jobs) seen.insert(job.problem_name);
    EXPECT_EQ(seen.size(), 2U);
    all.insert(seen.begin(), seen.end());
  }
  EXPECT_EQ(all, (std::multiset<std::string>{"cell arm0", "cell arm1", "cell arm2", "cell arm3", "cell arm4",
                                             "cell arm5"}));
}

TEST_F(CoupledSessions, AKilledServerCostsRepeatedBlocksAndNoError) {
  start();
  const Client client = Client::connect(address_).value();
  const CoupledControls controls{.progress = [&](const CoupledIteration& now) {
    if (now.iteration == 2) servers_[1]->send(SIGKILL), servers_[1]->wait();
  }};
  const auto answer = client.solve_coupled_by_sessions(cell_.view(), {}, controls);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_GE(answer->repeated, 1);
  EXPECT_GT(answer->coordination.last.iteration, 2);
  expect_the_answer_of_this_process(*answer);
}

TEST_F(CoupledSessions, AServerThatIsAwayFromTheBeginningIsStarvationLimit) {
  start();
  servers_[0]->send(SIGKILL), servers_[0]->wait();
  const Client client = Client::connect(address_).value();
  const auto answer = client.solve_coupled_by_sessions(cell_.view());
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  expect_the_answer_of_this_process(*answer);
}

TEST_F(CoupledSessions, WhereThereIsNoRoomForSessionsEachStepIsASolve) {
  start({"--sessions", "0"});
  const Client client = Client::connect(address_).value();
  const auto answer = client.solve_coupled_by_sessions(cell_.view());
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  expect_the_answer_of_this_process(*answer);
  EXPECT_EQ(single_[0].info()->sessions_opened, 0);
}

TEST_F(CoupledSessions, WithoutAnyServerTheyAreUnavailable) {
  start();
  for (const auto& server : servers_) server->send(SIGKILL), server->wait();
  const Client client = Client::connect(address_).value();
  const auto answer = client.solve_coupled_by_sessions(cell_.view());
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::unavailable);
}

TEST_F(CoupledSessions, AStopIsTheErrorCancelledAndNoSessionStays) {
  start();
  const Client client = Client::connect(address_).value();
  std::stop_source stop;
  const CoupledControls controls{.progress = [&](const CoupledIteration&) { stop.request_stop(); },
                                 .stop = stop.get_token()};
  EXPECT_EQ(client.solve_coupled_by_sessions(cell_.view(), {}, controls).error().code, ErrorCode::cancelled);
  EXPECT_EQ(Client::in_process().solve_coupled_by_sessions(cell_.view(), {}, controls).error().code,
            ErrorCode::cancelled);
  for (const Client& server : single_) EXPECT_TRUE(eventually([&] { return server.info()->sessions == 0; }));
}

TEST_F(CoupledSessions, TheTimeLimitIsAnAnswer) {
  start();
  const Client client = Client::connect(address_).value();
  CoupledOptions options;
  options.options.time_limit_s = 0.0;
  const auto answer = client.solve_coupled_by_sessions(cell_.view(), options);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->monolithic.status, Status::time_limit);
}

TEST_F(CoupledSessions, ALongHorizonsSegmentsAgreeThoughAServerIsKilled) {
  start();
  const Client client = Client::connect(address_).value();
  const examples::HopperParameters parameters{.steps = 24};
  const OwnedProblem hopper = examples::hopper(parameters);
  const Problem problem = Problem::create(hopper.view()).value();
  std::vector<Index> stages;
  for (Index step = 0; step < parameters.steps; ++step)
    stages.insert(stages.end(), examples::kHopperVariables, step);
  const SegmentsOptions options{.num_segments = 4};
  const SegmentsSolution here = solve_in_segments(problem, stages, options).value();
  const CoupledControls controls{.progress = [&](const CoupledIteration& now) {
    if (now.iteration == 2) servers_[2]->send(SIGKILL), servers_[2]->wait();
  }};
  const auto answer = client.solve_in_segments_by_sessions(problem, stages, options, controls);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->coordination.status, here.coordination.status) << answer->coordination.detail;
  EXPECT_GE(answer->repeated, 1);
  EXPECT_NEAR(answer->whole.objective, here.whole.objective, 1e-7 * (1.0 + std::abs(here.whole.objective)));
}

TEST_F(CoupledSessions, OnOneServerItIsOneCallWithTheBitsOfThisProcess) {
  start();
  std::vector<CoupledIteration> reported;
  const CoupledControls controls{.progress = [&](const CoupledIteration& now) { reported.push_back(now); }};
  const RemoteCoupledSolution there = single_[0].solve_coupled(cell_.view(), {}, controls).value();
  const CoupledSolution here = solve_coupled(cell_.view()).value();
  EXPECT_EQ(there.monolithic.z, here.monolithic.z);
  EXPECT_EQ(there.monolithic.objective, here.monolithic.objective);
  EXPECT_EQ(there.coordination.coupling_multipliers, here.coordination.coupling_multipliers);
  EXPECT_EQ(there.coordination.status, here.coordination.status);
  EXPECT_EQ(there.coordination.last.iteration, here.coordination.last.iteration);
  EXPECT_EQ(there.coordination.last.factorizations, here.coordination.last.factorizations);
  EXPECT_EQ(there.places.back().variables, here.places.back().variables);
  ASSERT_FALSE(reported.empty());
  EXPECT_EQ(reported.back().proximal, here.coordination.last.proximal);
  EXPECT_EQ(single_[0].jobs().get(there.job_id)->job.kind, JobKind::coupled);
  const RemoteCoupledSolution in_process = Client::in_process().solve_coupled(cell_.view()).value();
  EXPECT_EQ(in_process.monolithic.z, here.monolithic.z);
}

TEST_F(CoupledSessions, SegmentsOnOneServerHaveTheBitsOfThisProcess) {
  start();
  const OwnedProblem hopper = examples::hopper({.steps = 12});
  const Problem problem = Problem::create(hopper.view()).value();
  std::vector<Index> stages;
  for (Index step = 0; step < 12; ++step) stages.insert(stages.end(), examples::kHopperVariables, step);
  const SegmentsSolution here = solve_in_segments(problem, stages).value();
  const RemoteSegmentsSolution there = single_[0].solve_in_segments(problem, stages).value();
  EXPECT_EQ(there.whole.z, here.whole.z);
  EXPECT_EQ(there.sweep_objective, here.sweep_objective);
  EXPECT_EQ(there.sweep_factorizations, here.sweep_factorizations);
  EXPECT_EQ(single_[0].solve_in_segments(problem, stages, {.num_segments = 13}).error().field,
            "num_segments");
}

TEST_F(CoupledSessions, SubmittedTheyAnswerLaterWithTheBitsOfTheCall) {
  start();
  const Jobs jobs = single_[0].jobs();
  const SubmittedJob job = jobs.submit(cell_.view(), {}, {}, {.problem_name = "cell"}).value();
  const RemoteCoupledSolution later = jobs.coupled(job.job_id, cell_.view(), {.wait = true}).value();
  const RemoteCoupledSolution now = single_[0].solve_coupled(cell_.view()).value();
  EXPECT_EQ(later.monolithic.z, now.monolithic.z);
  EXPECT_EQ(later.coordination.coupling_multipliers, now.coordination.coupling_multipliers);
  EXPECT_EQ(later.coordination.last.iteration, now.coordination.last.iteration);
  EXPECT_EQ(later.blocks_objective, now.blocks_objective);
  EXPECT_EQ(later.places.size(), now.places.size());
  EXPECT_EQ(later.job_id, job.job_id);
  EXPECT_GT(later.total_s, 0.0);
  EXPECT_EQ(jobs.get(job.job_id)->job.problem_name, "cell");
  OwnedCoupled other = cell_;
  other.blocks.pop_back();
  EXPECT_EQ(jobs.coupled(job.job_id, other.view()).error().field, "blocks");

  const OwnedProblem hopper = examples::hopper({.steps = 12});
  const Problem problem = Problem::create(hopper.view()).value();
  std::vector<Index> stages;
  for (Index step = 0; step < 12; ++step) stages.insert(stages.end(), examples::kHopperVariables, step);
  const SubmittedJob cut = jobs.submit_in_segments(problem, stages).value();
  const RemoteSegmentsSolution segments = jobs.segments(cut.job_id, {.wait = true}).value();
  const RemoteSegmentsSolution at_once = single_[0].solve_in_segments(problem, stages).value();
  EXPECT_EQ(segments.whole.z, at_once.whole.z);
  EXPECT_EQ(segments.sweep_objective, at_once.sweep_objective);

  const SubmittedJob plain = jobs.submit(hopper.view()).value();
  EXPECT_EQ(jobs.segments(plain.job_id, {.wait = true}).error().code, ErrorCode::failed_precondition);
}

TEST_F(CoupledSessions, AFaultHasTheFieldOfThisProcessWhereverItIsFound) {
  start();
  OwnedCoupled bad = cell_;
  bad.blocks[1].g[3] = std::numeric_limits<double>::infinity();
  for (const Client* client : {&single_[0], &single_[1]}) {
    const Error error = client == &single_[0] ? client->solve_coupled(bad.view()).error()
                                              : client->solve_coupled_by_sessions(bad.view()).error();
    EXPECT_EQ(error.code, ErrorCode::invalid_argument);
    EXPECT_EQ(error.field, "blocks[1].problem.g");
    EXPECT_EQ(error.index, 3);
  }
  CoupledOptions options;
  options.proximal = -1.0;
  EXPECT_EQ(single_[0].solve_coupled(cell_.view(), options).error().field, "proximal");
  EXPECT_EQ(single_[0].jobs().submit(cell_.view(), options).error().field, "proximal");
}

}  // namespace
}  // namespace marble::testing
