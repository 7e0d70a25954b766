// The same loop over sessions: in process and on a server, to the last bit, and what becomes of it when that
// dies.
#include <gtest/gtest.h>

#include "formula.h"
#include "marble/client.h"
#include "sampled_bt6.h"
#include "support/processes/server_process.h"

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

TEST_F(NonlinearSessions, TellWhatTheirTicksDo) {
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

}  // namespace
}  // namespace marble::testing
