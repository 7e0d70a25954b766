// The same loop over sessions: in process and on a server, to the last bit, and what becomes of it when that
// dies.
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "formula.h"
#include "hopping_robot.h"
#include "marble/client.h"
#include "marble/real_time.h"
#include "sampled_bt6.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

void expect_same_bits(const nonlinear::Answer& a, const nonlinear::Answer& b, const std::string& name) {
  EXPECT_EQ(a.status, b.status) << name;
  EXPECT_EQ(a.x, b.x) << name;
  EXPECT_EQ(a.objective, b.objective) << name;
  EXPECT_EQ(a.multipliers.equalities, b.multipliers.equalities) << name;
  EXPECT_EQ(a.multipliers.G, b.multipliers.G) << name;
  EXPECT_EQ(a.multipliers.H, b.multipliers.H) << name;
  EXPECT_EQ(a.multipliers.bounds, b.multipliers.bounds) << name;
  EXPECT_EQ(a.ticks, b.ticks) << name;
  EXPECT_EQ(a.factorizations, b.factorizations) << name;
  EXPECT_EQ(a.b_stationary, b.b_stationary) << name;
}

class NonlinearSessions : public ::testing::Test {
 protected:
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "1"}};
  Expected<Client> there_ = Client::connect(server_.address());
};

TEST_F(NonlinearSessions, GiveTheSameBitsHereOnAServerAndByCoreAlone) {
  const Client here = Client::in_process();
  for (const Formula& formula : equilibrium_problems()) {
    const auto problem = problem_of(formula);
    const auto by_core = nonlinear::solve(problem, nonlinear::open_ticks_in_process);
    const auto in_process = nonlinear::solve(problem, here);
    const auto on_server = nonlinear::solve(problem, *there_);
    ASSERT_TRUE(by_core && in_process) << formula.name;
    ASSERT_TRUE(on_server.has_value()) << formula.name << ": " << on_server.error().message();
    expect_same_bits(*in_process, *by_core, formula.name);
    expect_same_bits(*on_server, *by_core, formula.name);
  }
}

TEST_F(NonlinearSessions, GiveTheSameBitsAtEveryLevelOfSamples) {
  const nonlinear::RetrospectiveSettings settings{.levels = 8};
  SampledBt6 first(1), second(1), third(1);
  const auto by_core =
      nonlinear::solve_retrospective(first.sampled(), nonlinear::open_ticks_in_process, settings);
  const auto in_process = nonlinear::solve_retrospective(second.sampled(), Client::in_process(), settings);
  const auto on_server = nonlinear::solve_retrospective(third.sampled(), *there_, settings);
  ASSERT_TRUE(by_core && in_process);
  ASSERT_TRUE(on_server.has_value()) << on_server.error().message();
  expect_same_bits(in_process->answer, by_core->answer, "in process");
  expect_same_bits(on_server->answer, by_core->answer, "on a server");
}

class Counter final : public ProgressSink {
 public:
  void report(const Progress&) override { ++rows; }
  int rows = 0;
};

TEST_F(NonlinearSessions, ReportWhatTheirTicksDo) {
  Counter counter;
  const auto answer =
      nonlinear::solve(problem_of(equilibrium_problems().back()), *there_, {.progress = &counter});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_GT(counter.rows, 0);
}

TEST_F(NonlinearSessions, EndInWordsWhenTheServerDies) {
  nonlinear::Settings settings;
  settings.iteration = [this](const nonlinear::Iteration& row) {
    if (row.iteration != 1) return;
    server_.send(SIGKILL);
    server_.wait();
  };
  const auto answer = nonlinear::solve(problem_of(equilibrium_problems().back()), *there_, settings);
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::unavailable) << answer.error().message();
  EXPECT_NE(answer.error().message(), "");
}

// Two servers behind one address. Whichever has the session of the moment can be killed.
class TwoServers : public ::testing::Test {
 protected:
  void SetUp() override {
    for (auto& server : servers_)
      server =
          std::make_unique<ServerProcess>(MARBLE_SERVER_BINARY, std::vector<std::string>{"--workers", "1"});
    either_ = Client::connect(servers_[0]->address() + "," + servers_[1]->address());
  }
  void kill_the_one_in_use() {
    for (auto& server : servers_) {
      if (server == nullptr) continue;
      const auto alone = Client::connect(server->address());
      if (alone->info().value().sessions == 0) continue;
      server->send(SIGKILL);
      server->wait();
      server = nullptr;
    }
  }

  std::unique_ptr<ServerProcess> servers_[2];
  Expected<Client> either_ = Client::in_process();
};

// Of one session: no subproblem is elastic.
nonlinear::Problem problem_of_one_session() {
  for (const Formula& formula : equilibrium_problems()) {
    bool elastic = false;
    nonlinear::Settings settings;
    settings.iteration = [&](const nonlinear::Iteration& row) { elastic = elastic || row.elastic; };
    const auto answer = nonlinear::solve(problem_of(formula), nonlinear::open_ticks_in_process, settings);
    if (answer && answer->status == Status::solved && !elastic && answer->iterations > 4)
      return problem_of(formula);
  }
  throw std::runtime_error("no such problem");
}

TEST_F(TwoServers, ANonlinearSolveGoesOnOnTheOtherOneIfItMayReopen) {
  const auto problem = problem_of_one_session();
  nonlinear::Settings settings;
  settings.reopen = true;
  settings.iteration = [this](const nonlinear::Iteration& row) {
    if (row.iteration == 1) kill_the_one_in_use();
  };
  const auto answer = nonlinear::solve(problem, *either_, settings);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  const auto undisturbed = nonlinear::solve(problem, nonlinear::open_ticks_in_process);
  EXPECT_EQ(answer->status, Status::solved) << answer->detail;
  EXPECT_EQ(answer->reopened, 1);
  EXPECT_EQ(undisturbed->reopened, 0);
  EXPECT_NEAR(answer->objective, undisturbed->objective, 1e-6);
}

constexpr int kFewTicks = 6;

// A hopper for a few ticks, each measured as the last plan said.
template <class EachTick>
Expected<std::vector<nonlinear::RealTimeTick>> hop(nonlinear::RealTimeSettings settings, const Client* client,
                                                   EachTick&& each) {
  HoppingRobot robot(20);
  settings.shift = robot.one_stage();
  const nonlinear::Measured measured = {.equalities = {0, 1, 2, 3}};
  MARBLE_ASSIGN_OR_RETURN(
      auto loop,
      client == nullptr
          ? nonlinear::RealTime::create(robot.problem(), measured, nonlinear::open_ticks_in_process, settings)
          : nonlinear::RealTime::create(robot.problem(), measured, *client, settings));
  std::vector<nonlinear::RealTimeTick> ticks;
  HoppingRobot::State state = HoppingRobot::standing();
  for (int number = 0; number < kFewTicks; ++number) {
    robot.set(number);
    each(number, false);
    MARBLE_RETURN_IF_ERROR(loop.prepare());
    each(number, true);
    MARBLE_ASSIGN_OR_RETURN(auto tick, loop.feedback(state));
    std::copy_n(tick.x.begin() + HoppingRobot::kState, state.size(), state.begin());
    ticks.push_back(std::move(tick));
  }
  return ticks;
}

void nothing(int, bool) {}

TEST_F(NonlinearSessions, GiveTheSameTicksInRealTimeHereOnAServerAndByCoreAlone) {
  const Client here = Client::in_process();
  const auto by_core = hop({}, nullptr, nothing), in_process = hop({}, &here, nothing),
             on_server = hop({}, &*there_, nothing);
  ASSERT_TRUE(by_core && in_process);
  ASSERT_TRUE(on_server.has_value()) << on_server.error().message();
  for (int i = 0; i < kFewTicks; ++i) {
    for (const auto* other : {&*in_process, &*on_server}) {
      EXPECT_EQ((*other)[i].outcome, nonlinear::Outcome::answered) << (*other)[i].why;
      EXPECT_EQ((*other)[i].x, (*by_core)[i].x) << "tick " << i;
      EXPECT_EQ((*other)[i].multipliers.G, (*by_core)[i].multipliers.G) << "tick " << i;
      EXPECT_EQ((*other)[i].factorizations, (*by_core)[i].factorizations) << "tick " << i;
    }
  }
}

TEST_F(NonlinearSessions, EndInWordsWhenTheServerDiesBetweenTheTwoPartsOfATick) {
  const auto ticks = hop({}, &*there_, [this](int number, bool prepared) {
    if (number != 2 || !prepared) return;
    server_.send(SIGKILL);
    server_.wait();
  });
  ASSERT_FALSE(ticks.has_value());
  EXPECT_EQ(ticks.error().code, ErrorCode::unavailable) << ticks.error().message();
  EXPECT_NE(ticks.error().message(), "");
}

TEST_F(TwoServers, RealTimeIterationGoesOnOnTheOtherOneIfItMayReopen) {
  for (const bool between_the_parts : {false, true}) {
    SetUp();
    const auto ticks = hop({.reopen = true}, &*either_, [&](int number, bool prepared) {
      if (number == 3 && prepared == between_the_parts) kill_the_one_in_use();
    });
    ASSERT_TRUE(ticks.has_value()) << ticks.error().message();
    for (int i = 0; i < kFewTicks; ++i) {
      EXPECT_EQ((*ticks)[i].outcome, nonlinear::Outcome::answered) << (*ticks)[i].why;
      EXPECT_LE((*ticks)[i].violation, 1e-6) << "tick " << i;
      EXPECT_EQ((*ticks)[i].reopened, i == 3 ? 1 : 0) << "tick " << i;
    }
  }
}

}  // namespace
}  // namespace marble::testing
