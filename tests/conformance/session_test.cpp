// What a session promises: the answers of a Solver kept in process, and a life of its own.
#include "marble/session.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <filesystem>
#include <future>
#include <thread>

#include "marble/client.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "problems.h"
#include "support/losing_relay.h"
#include "support/same_solution.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

constexpr int kSteps = 12;

ProblemUpdate vectors_of(const OwnedProblem& p) {
  return {.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r};
}

class SessionTest : public ::testing::Test {
 protected:
  // The one worker is taken until the job is cancelled.
  std::string occupy_worker() {
    const v1::SolveRequest request = long_request();
    const auto job =
        client_->jobs().submit(view_of(request.problem()), options_of(request.options()).value(), {},
                               {.priority = Priority::realtime});  // it steps aside for no session
    EXPECT_TRUE(eventually([&] { return client_->jobs().get(job->job_id)->job.state == JobState::running; }));
    return job->job_id;
  }

  OwnedProblem example_ = public_example().problem;
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "1"}};
  Expected<Client> client_ = Client::connect(server_.address());
};

TEST_F(SessionTest, AWarmSessionEqualsASolverInProcessBitForBit) {
  examples::HopperParameters parameters{.steps = kSteps};
  const OwnedProblem first = examples::hopper(parameters);
  Solver solver = Solver::create(Problem::create(first.view()).value()).value();
  auto session = client_->open_session(first.view());
  ASSERT_TRUE(session.has_value()) << session.error().message();
  Solution here = solver.solve().value();
  auto there = session->solve();
  for (int tick = 1; tick <= 5; ++tick) {
    ASSERT_TRUE(there.has_value()) << there.error().message();
    ASSERT_TRUE(is_solved(here.status)) << here.detail;
    expect_same_bits(*there, here);
    EXPECT_EQ(there->job_id, session->job_id());
    parameters = examples::advance(parameters, here.z);
    const OwnedProblem next = examples::hopper(parameters);
    const Solution start = examples::shift_hopper(here);
    ASSERT_TRUE(solver.update(vectors_of(next)).has_value());
    here = solver.solve({.warm_start = &start}).value();
    there = session->solve(vectors_of(next), {.shift = Shift::by_stage(first.view(), kSteps).value()});
  }
  EXPECT_EQ(session->close().has_value(), true);
  EXPECT_FALSE(session->is_open());
}

TEST_F(SessionTest, TwoPartsGiveTheBitsOfOneUpdateHereAndThere) {
  examples::HopperParameters parameters{.steps = kSteps};
  const OwnedProblem first = examples::hopper(parameters);
  const Client here = Client::in_process();
  auto whole = here.open_session(first.view()), parts_here = here.open_session(first.view()),
       parts_there = client_->open_session(first.view());
  ASSERT_TRUE(whole && parts_here && parts_there);
  for (int tick = 0; tick < 5; ++tick) {
    const OwnedProblem now = examples::hopper(parameters);
    UpdateControls controls;
    if (tick > 0) controls.shift = Shift::by_stage(first.view(), kSteps).value();
    const auto one = whole->solve(vectors_of(now), controls);
    ASSERT_TRUE(one.has_value());
    for (auto* session : {&*parts_here, &*parts_there}) {
      const auto number = session->prepare({.c0 = now.c0, .g = now.g, .d = now.d}, controls);
      ASSERT_TRUE(number.has_value()) << number.error().message();
      EXPECT_EQ(*number, 2 * tick + 1);
      const auto two = session->solve({.b = now.b});
      ASSERT_TRUE(two.has_value()) << two.error().message();
      expect_same_bits(*two, *one);
    }
    parameters = examples::advance(parameters, one->z);
  }
}

TEST_F(SessionTest, AFirstPartIsCheckedBeforeItGoesOut) {
  const Client here = Client::in_process();
  const std::vector<double> few = {1.0};
  const Client* const both[] = {&here, &*client_};
  for (const Client* client : both) {
    auto session = client->open_session(examples::hopper({.steps = kSteps}).view());
    ASSERT_TRUE(session.has_value());
    const auto refused = session->prepare({.g = few});
    EXPECT_EQ(refused.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(refused.error().field, "g");
    EXPECT_TRUE(session->solve().has_value());
    ASSERT_TRUE(session->close().has_value());
    EXPECT_EQ(session->prepare({}).error().code, ErrorCode::failed_precondition);
  }
}

TEST_F(SessionTest, NextReportsNothingOfAFirstPart) {
  auto session = client_->open_session(example_.view());
  ASSERT_TRUE(session.has_value());
  ASSERT_TRUE(session->prepare({}).has_value());
  const auto sent = session->send();
  ASSERT_TRUE(sent.has_value());
  EXPECT_EQ(*sent, 2);
  ASSERT_TRUE(session->close().has_value());
  const auto event = session->next();
  ASSERT_TRUE(event && *event);
  EXPECT_EQ((*event)->sequence, 2);
  EXPECT_FALSE(session->next()->has_value());
}

TEST_F(SessionTest, ColdForgetsTheLastAnswer) {
  const OwnedProblem p = examples::hopper({.steps = kSteps});
  auto session = client_->open_session(p.view());
  ASSERT_TRUE(session.has_value());
  const auto first = session->solve();
  const auto warm = session->solve();
  const auto cold = session->solve({}, {.cold = true});
  ASSERT_TRUE(first && warm && cold);
  EXPECT_LT(warm->factorizations, first->factorizations);
  expect_same_bits(*cold, *first);
}

TEST_F(SessionTest, ARefusedUpdateLeavesTheSessionUsable) {
  auto session = client_->open_session(example_.view());
  ASSERT_TRUE(session.has_value());
  const auto before = session->solve();
  std::vector<double> broken = example_.g;
  broken[1] = std::numeric_limits<double>::quiet_NaN();
  const auto refused = session->solve({.g = broken});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(refused.error().field, "g");
  EXPECT_EQ(refused.error().index, 1);
  const auto short_values = session->solve({.A = std::span(example_.A.values).first(0), .L = example_.g});
  ASSERT_FALSE(short_values.has_value());
  EXPECT_EQ(short_values.error().field, "L.values");
  Options bad;
  bad.kappa_factor = 2.0;
  const auto option = session->solve({}, {.options = bad});
  ASSERT_FALSE(option.has_value());
  EXPECT_EQ(option.error().field, "kappa_factor");
  EXPECT_EQ(session->solve({}, {.shift = {.variables = {{0, 99, 1}}}}).error().field,
            "shift.variables[0].count");
  EXPECT_TRUE(session->is_open());
  const auto after = session->solve({}, {.cold = true});
  ASSERT_TRUE(after.has_value()) << after.error().message();
  EXPECT_EQ(after->z, before->z);
}

TEST_F(SessionTest, ASetUpThatIsWrongNamesTheField) {
  OwnedProblem p = example_;
  p.g[0] = std::numeric_limits<double>::infinity();
  const auto session = client_->open_session(p.view());
  ASSERT_FALSE(session.has_value());
  EXPECT_EQ(session.error().field, "g");
  EXPECT_EQ(client_->open_session(example_.view(), {}, {.request_id = "\n"}).error().field, "request_id");
  EXPECT_EQ(client_->open_session(example_.view(), {}, {.progress_interval_s = -1.0}).error().field,
            "progress_interval_s");
}

TEST_F(SessionTest, LatestOnlySupersedesWhatWaits) {
  auto session = client_->open_session(example_.view(), {}, {.latest_only = true});
  ASSERT_TRUE(session.has_value());
  const std::string blocker = occupy_worker();
  std::vector<double> moved = example_.g;
  moved[0] += 0.5;
  EXPECT_EQ(session->send(), 1);              // waits for the worker
  EXPECT_EQ(session->send({.g = moved}), 2);  // waits behind it
  EXPECT_EQ(session->send({.c0 = 7.0}), 3);   // takes its place and its numbers
  const auto superseded = session->next();
  ASSERT_TRUE(superseded.has_value() && superseded->has_value());
  EXPECT_EQ((*superseded)->sequence, 2);
  EXPECT_EQ(std::get<Superseded>((*superseded)->outcome).by_sequence, 3);
  ASSERT_TRUE(client_->jobs().cancel(blocker).has_value());
  EXPECT_EQ(session->next().value()->sequence, 1);
  const auto last = session->next().value();
  EXPECT_EQ(last->sequence, 3);
  OwnedProblem both = example_;
  both.g = moved;
  both.c0 = 7.0;
  EXPECT_NEAR(std::get<RemoteSolution>(last->outcome).objective, solve_in_process(both.view())->objective,
              1e-6);
  EXPECT_TRUE(session->close().has_value());
  EXPECT_FALSE(session->next().value().has_value()) << "nothing is left";
  EXPECT_EQ(session->send().error().code, ErrorCode::failed_precondition);
}

TEST_F(SessionTest, CloseWaitsForTheAnswersAndNextStillGivesThem) {
  auto session = client_->open_session(example_.view());
  for (int i = 1; i <= 20; ++i) EXPECT_EQ(session->send(), i);
  EXPECT_TRUE(session->close().has_value());
  for (int i = 1; i <= 20; ++i) {
    const auto event = session->next();
    ASSERT_TRUE(event.has_value() && event->has_value());
    EXPECT_EQ((*event)->sequence, i);
    EXPECT_TRUE(std::holds_alternative<RemoteSolution>((*event)->outcome));
  }
  EXPECT_FALSE(session->next().value().has_value());
}

TEST_F(SessionTest, OneThreadSendsWhileAnotherReads) {
  auto session = client_->open_session(example_.view());
  constexpr int kUpdates = 500;  // many more than the server lets wait
  std::thread sender([&] {
    for (int i = 0; i < kUpdates; ++i) EXPECT_TRUE(session->send().has_value());
  });
  int answers = 0;
  while (answers < kUpdates) {
    const auto event = session->next();
    ASSERT_TRUE(event.has_value() && event->has_value());
    EXPECT_EQ((*event)->sequence, ++answers);
  }
  sender.join();
}

// Calls that may be repeated would succeed once the relay passes responses.
TEST_F(SessionTest, AStreamWhoseFirstMessageWasReadIsNotRepeated) {
  const OwnedProblem large = examples::hopper({.steps = 60});
  LosingRelay relay(server_.address());
  const Client far = Client::connect(relay.address()).value();
  auto opened = std::async(std::launch::async, [&] { return far.open_session(large.view()); });
  EXPECT_TRUE(eventually([&] { return client_->info()->sessions_opened == 1; }));
  relay.cut();
  const auto session = opened.get();
  ASSERT_FALSE(session.has_value());
  EXPECT_EQ(session.error().code, ErrorCode::unavailable);
  EXPECT_TRUE(far.info().has_value());
  EXPECT_EQ(client_->info()->sessions_opened, 1);
}

TEST_F(SessionTest, AnUpdatesDeadlineIsItsAlone) {
  auto session = client_->open_session(example_.view());
  ASSERT_TRUE(session.has_value());
  const auto late = session->solve({}, {.deadline = std::chrono::duration<double>(-1.0)});
  ASSERT_FALSE(late.has_value());
  EXPECT_EQ(late.error().code, ErrorCode::deadline_exceeded);
  EXPECT_TRUE(session->is_open());
  EXPECT_TRUE(session->solve().has_value());
}

TEST_F(SessionTest, ProgressGoesToTheUpdatesSink) {
  struct Count final : ProgressSink {
    void report(const Progress& progress) override { last = progress.iteration, ++rows; }
    int rows = 0, last = -1;
  };
  auto session = client_->open_session(example_.view(), {}, {.progress = true});
  Count first, second;
  const auto a = session->solve({}, {.progress = &first});
  const auto b = session->solve({}, {.cold = true, .progress = &second});
  ASSERT_TRUE(a && b);
  EXPECT_GT(first.rows, 0);
  EXPECT_EQ(first.last, a->iterations);
  EXPECT_EQ(second.rows, first.rows);
}

TEST_F(SessionTest, ItsStopTokenGivesItUpAndTheServerForgetsIt) {
  std::stop_source source;
  const v1::SolveRequest request = long_request();
  auto session = client_->open_session(view_of(request.problem()), options_of(request.options()).value(),
                                       {.stop = source.get_token()});
  ASSERT_TRUE(session.has_value()) << session.error().message();
  std::thread stopper([&] {
    EXPECT_TRUE(eventually([&] { return client_->info()->running == 1; }));
    source.request_stop();
  });
  const auto answer = session->solve();
  stopper.join();
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::cancelled);
  EXPECT_EQ(answer.error().bound, "cancelled by the caller");
  EXPECT_FALSE(session->is_open());
  EXPECT_EQ(session->send().error().code, ErrorCode::cancelled);
  EXPECT_EQ(session->next().error().code, ErrorCode::cancelled);
  EXPECT_TRUE(eventually([&] { return client_->info()->sessions == 0; }));
}

TEST_F(SessionTest, ADestroyedOneFreesTheServer) {
  {
    auto session = client_->open_session(example_.view());
    ASSERT_TRUE(session.has_value());
    EXPECT_GT(session->memory_bytes(), 0);
    EXPECT_EQ(client_->info()->sessions, 1);
    static_cast<void>(session->send());
  }
  EXPECT_TRUE(eventually([&] { return client_->info()->sessions == 0; }));
}

TEST(SessionLife, AnIdleOneIsEndedByTheServer) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--session-idle-s", "3"});
  auto client = Client::connect(server.address());
  auto session = client->open_session(public_example().problem.view());
  ASSERT_TRUE(session.has_value());
  EXPECT_EQ(session->idle_timeout_s(), 3.0);
  const auto end = session->next();
  ASSERT_FALSE(end.has_value());
  EXPECT_EQ(end.error().code, ErrorCode::aborted);
  const auto later = session->solve();
  ASSERT_FALSE(later.has_value());
  EXPECT_EQ(later.error().code, ErrorCode::aborted) << later.error().message();
}

std::ptrdiff_t threads() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return std::distance(begin(tasks), end(tasks));
}

// A server takes 1024 streams on a connection, and gRPC holds back what is more.
TEST(Sessions, MoreThanAConnectionHasRoomForLeaveOtherCallsTheirsAndTakeNoThreads) {
  constexpr int kFew = 100, kSessions = 5000;
  const ServerProcess server(MARBLE_SERVER_BINARY, {"--sessions", "6000", "--client-sessions", "0"});
  const Client client = Client::connect(server.address()).value();
  const OwnedProblem example = public_example().problem;
  std::vector<Session> sessions;
  std::ptrdiff_t of_few = 0;
  for (int i = 0; i < kSessions; ++i) {
    auto session = client.open_session(example.view());
    ASSERT_TRUE(session.has_value()) << i << ": " << session.error().message();
    sessions.push_back(*std::move(session));
    if (i == kFew) of_few = threads();
  }
  EXPECT_LE(threads(), of_few + 8) << "gRPC has some of its own";
  EXPECT_EQ(client.info()->sessions, kSessions);
  EXPECT_TRUE(client.solve(example.view()).has_value());
  for (Session& session : sessions) EXPECT_TRUE(session.solve().has_value());
}

// A stopped process: its kernel goes on taking bytes, and nobody answers.
TEST(Keepalive, AServerThatFallsSilentIsNoticedByASessionThatWaits) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--keepalive-s", "2"});
  const ConnectOptions options = {
      .keepalive = {.silence = std::chrono::seconds(1), .answer = std::chrono::milliseconds(500)}};
  const OwnedProblem problem = examples::hopper({.steps = 5});
  auto session = Client::connect(server.address(), options)->open_session(problem.view());
  ASSERT_TRUE(session.has_value()) << session.error().message();
  ASSERT_TRUE(session->solve().has_value());
  server.send(SIGSTOP);
  ASSERT_EQ(waitpid(server.pid(), nullptr, WUNTRACED), server.pid());  // all its threads
  const auto answer = session->solve();
  server.send(SIGCONT);
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::unavailable) << answer.error().message();
}

}  // namespace
}  // namespace marble::testing
