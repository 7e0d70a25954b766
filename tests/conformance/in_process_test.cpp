// Here and there by the same calls: a client without a server, and marble::solve, which the environment
// sends.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <optional>

#include "marble/client.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "problems.h"
#include "support/same_solution.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

using namespace std::chrono_literals;

class CountedRows final : public ProgressSink {
 public:
  void report(const Progress& progress) override {
    iterations.push_back(progress.iteration);
    with_z += progress.z.empty() ? 0 : 1;
  }
  std::vector<int> iterations;
  int with_z = 0;
};

template <class T>
void expect_same_error(const Expected<T>& here, const Expected<T>& there) {
  ASSERT_FALSE(here.has_value());
  ASSERT_FALSE(there.has_value());
  EXPECT_EQ(here.error().code, there.error().code);
  EXPECT_EQ(here.error().field, there.error().field);
  EXPECT_EQ(here.error().index, there.error().index);
  EXPECT_EQ(here.error().bound, there.error().bound);
}

class InProcess : public ::testing::Test {
 protected:
  ServerProcess server_{MARBLE_SERVER_BINARY};
  const Client here_ = Client::in_process();
  const Client there_ = Client::connect(server_.address()).value();
  // Goes on until it is stopped.
  const v1::SolveRequest long_ = long_request();
  const ProblemView endless_ = view_of(long_.problem());
  const Options tiny_steps_ = options_of(long_.options()).value();
};

TEST_F(InProcess, OneSolveHasTheBitsAndTheRowsOfTheServer) {
  const OwnedProblem p = examples::hopper();
  CountedRows here, there;
  const CallControls call{.iterate_every = 2};
  const SolveControls from{.initial_z = p.initial_z};
  SolveControls reported_here = from, reported_there = from;
  reported_here.progress = &here;
  reported_there.progress = &there;
  expect_same_bits(here_.solve(p.view(), {}, reported_here, call).value(),
                   there_.solve(p.view(), {}, reported_there, call).value());
  EXPECT_EQ(here.iterations, there.iterations);
  const auto even =
      std::count_if(here.iterations.begin(), here.iterations.end(), [](int i) { return i % 2 == 0; });
  EXPECT_EQ(here.with_z, even);
  EXPECT_LE(there.with_z, even) << "a row that waits gives its z up for a newer one";
}

// A loop as a planner writes it, for whichever client it is given.
std::vector<RemoteSolution> plan(const Client& client) {
  examples::HopperParameters parameters{.steps = 12};
  OwnedProblem p = examples::hopper(parameters);
  Session session = client.open_session(p.view(), {}, {.initial_z = p.initial_z}).value();
  std::vector<RemoteSolution> plans{session.solve().value()};
  for (int tick = 1; tick <= 5; ++tick) {
    parameters = examples::advance(parameters, plans.back().z);
    p = examples::hopper(parameters);
    const ProblemUpdate update{.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r};
    plans.push_back(
        session.solve(update, {.cold = tick == 3, .shift = Shift::by_stage(p.view(), 12).value()}).value());
  }
  EXPECT_TRUE(session.close().has_value());
  EXPECT_FALSE(session.is_open());
  return plans;
}

TEST_F(InProcess, AClosedLoopIsTheSameCodeWithTheSameBits) {
  const auto here = plan(here_), there = plan(there_);
  ASSERT_EQ(here.size(), there.size());
  for (std::size_t i = 0; i < here.size(); ++i) {
    EXPECT_EQ(here[i].status, Status::solved) << here[i].detail;
    expect_same_bits(here[i], there[i]);
  }
}

TEST_F(InProcess, SentUpdatesAreAnsweredInTheirOrder) {
  const OwnedProblem p = examples::rocket();
  Session session = here_.open_session(p.view()).value();
  const std::int64_t first = session.send().value();
  const std::int64_t second = session.send({.g = std::vector<double>{1.0}}).value();
  ASSERT_TRUE(session.close().has_value());
  EXPECT_EQ(session.send().error().code, ErrorCode::failed_precondition);
  const SessionEvent answer = *session.next().value();
  EXPECT_EQ(answer.sequence, first);
  EXPECT_EQ(std::get<RemoteSolution>(answer.outcome).status, Status::solved);
  const SessionEvent refused = *session.next().value();
  EXPECT_EQ(refused.sequence, second);
  EXPECT_EQ(std::get<Error>(refused.outcome).field, "g");
  EXPECT_FALSE(session.next().value().has_value()) << "everything is fetched";
}

TEST_F(InProcess, WhatIsWrongIsSaidAlike) {
  const OwnedProblem good = public_example().problem;
  OwnedProblem bad = good;
  bad.A.row_indices[0] = 7;
  expect_same_error(here_.solve(bad.view()), there_.solve(bad.view()));
  expect_same_error(here_.open_session(bad.view()), there_.open_session(bad.view()));
  Session here = here_.open_session(good.view()).value(), there = there_.open_session(good.view()).value();
  const std::vector<double> short_z{1.0}, many(99, 1.0);
  Options options;
  options.kappa_factor = 7.0;
  UpdateControls shifted;
  shifted.shift.pairs = {{.first = 0, .count = 100, .by = 1}};
  expect_same_error(here.solve({.A = many}), there.solve({.A = many}));
  expect_same_error(here.solve({}, {.initial_z = short_z}), there.solve({}, {.initial_z = short_z}));
  expect_same_error(here.solve({}, {.options = options}), there.solve({}, {.options = options}));
  expect_same_error(here.solve({}, shifted), there.solve({}, shifted));
  EXPECT_TRUE(here.is_open());
  expect_same_bits(here.solve().value(), there.solve().value());
}

TEST_F(InProcess, DeadlinesAndStopsEndASolveHereAsThere) {
  const CallControls soon{.deadline = 50ms};
  EXPECT_EQ(here_.solve(endless_, tiny_steps_, {}, soon).error().code, ErrorCode::deadline_exceeded);
  EXPECT_EQ(there_.solve(endless_, tiny_steps_, {}, soon).error().code, ErrorCode::deadline_exceeded);
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_EQ(there_.solve(endless_, tiny_steps_, {.stop = stopped.get_token()}).error().code,
            ErrorCode::cancelled);
  EXPECT_EQ(here_.solve(endless_, tiny_steps_, {.stop = stopped.get_token()}).error().code,
            ErrorCode::cancelled);
  const auto best = solve_in_process(endless_, tiny_steps_, {.stop = stopped.get_token()});
  EXPECT_EQ(best.value().status, Status::cancelled) << "the solver itself has its best iterate";
  EXPECT_EQ(best->z.size(), endless_.g.size());
  Session session = here_.open_session(endless_, tiny_steps_).value();
  EXPECT_EQ(session.solve({}, {.deadline = 50ms})->status, Status::time_limit)
      << "a session has a best point";
  EXPECT_TRUE(session.is_open());
}

TEST_F(InProcess, AnAsyncSolveHasAThreadOfItsOwn) {
  const OwnedProblem p = examples::rocket();
  auto pending = here_.solve_async(p.view()).value();
  expect_same_bits(pending.get().value(), there_.solve(p.view()).value());
  EXPECT_EQ(pending.get().error().code, ErrorCode::failed_precondition) << "it was taken";
  auto endless = here_.solve_async(endless_, tiny_steps_).value();
  EXPECT_FALSE(endless.wait_for(20ms));
  endless.cancel();
  EXPECT_EQ(endless.get().error().code, ErrorCode::cancelled);
  auto given_up = here_.solve_async(endless_, tiny_steps_).value();  // its end waits for no endless solve
}

TEST_F(InProcess, ABatchAnswersEachOfItsProblems) {
  const OwnedProblem p = examples::rocket();
  OwnedProblem bad = p;
  bad.g.pop_back();
  const std::vector<BatchProblem> problems{{.tag = 1, .problem = p.view()},
                                           {.tag = 2, .problem = bad.view()}};
  std::vector<std::pair<std::int64_t, bool>> answers;
  const auto sink = [&](std::int64_t tag, Expected<RemoteSolution> answer) {
    answers.emplace_back(tag, answer.has_value());
  };
  ASSERT_TRUE(here_.solve_batch(problems, sink).has_value());
  EXPECT_EQ(answers, (std::vector<std::pair<std::int64_t, bool>>{{1, true}, {2, false}}));
}

TEST_F(InProcess, WhatOnlyAServerHasSaysSo) {
  EXPECT_EQ(here_.address(), "in process");
  EXPECT_TRUE(here_.healthy().value());
  EXPECT_EQ(here_.info().error().code, ErrorCode::unavailable);
  EXPECT_EQ(here_.jobs().list().error().code, ErrorCode::unavailable);
  EXPECT_EQ(here_.jobs().submit(endless_).error().code, ErrorCode::unavailable);
}

class Environment : public ::testing::Test {
 protected:
  void TearDown() override { unsetenv("MARBLE_SERVER"); }
  static void name(const std::string& address) { setenv("MARBLE_SERVER", address.c_str(), 1); }
  const OwnedProblem problem_ = examples::rocket();
};

TEST_F(Environment, SolveGoesToTheServerThatItNames) {
  name("local");
  const RemoteSolution here = marble::solve(problem_.view()).value();
  EXPECT_TRUE(here.job_id.empty());
  EXPECT_EQ(Client::connect().value().address(), "in process");
  std::optional<ServerProcess> first(std::in_place, MARBLE_SERVER_BINARY),
      second(std::in_place, MARBLE_SERVER_BINARY);
  name(first->address());
  const RemoteSolution there = marble::solve(problem_.view()).value();
  EXPECT_FALSE(there.job_id.empty());
  expect_same_bits(here, there);
  EXPECT_EQ(Client::connect().value().address(), first->address());
  name(second->address());
  first.reset();
  EXPECT_TRUE(marble::solve(problem_.view()).has_value()) << "the environment is read at every call";
  name("local");
  EXPECT_TRUE(marble::solve(problem_.view()).value().job_id.empty());
}

TEST_F(Environment, WhereNoServerIsNamedSolveStaysHereAndAClientAsksThisMachine) {
  unsetenv("MARBLE_SERVER");
  EXPECT_TRUE(marble::solve(problem_.view()).value().job_id.empty());
  EXPECT_EQ(Client::connect().value().address(), "127.0.0.1:50051");
  name("");
  EXPECT_TRUE(marble::solve(problem_.view()).value().job_id.empty());
  EXPECT_EQ(Client::connect().value().address(), "127.0.0.1:50051");
}

TEST_F(Environment, AServerThatIsNamedButNotThereIsAnErrorNotALocalSolve) {
  name("127.0.0.1:1");
  EXPECT_EQ(marble::solve(problem_.view(), {}, {}, {.deadline = 5s}).error().code, ErrorCode::unavailable);
  name("nonsense");
  EXPECT_EQ(marble::solve(problem_.view()).error().field, "address");
}

}  // namespace
}  // namespace marble::testing
