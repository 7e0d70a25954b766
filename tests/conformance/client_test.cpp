#include "marble/client.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <thread>

#include "marble/convert.h"
#include "marble/examples.h"
#include "problems.h"
#include "support/same_solution.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

// What the client promises beyond the solver's own contract: stop tokens, deadlines, events, addresses.
class ClientTest : public ::testing::Test {
 protected:
  // A solve that does not end by itself.
  Expected<RemoteSolution> solve_long(const SolveControls& controls, const CallControls& call = {}) {
    return client_->solve(view_of(request_.problem()), options_of(request_.options()).value(), controls,
                          call);
  }
  [[nodiscard]] bool server_becomes_idle() {
    return eventually([this] {
      const auto info = client_->info();
      return info && info->running == 0 && info->queued == 0;
    });
  }

  v1::SolveRequest request_ = long_request();
  OwnedProblem example_ = public_example().problem;
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "1"}};
  Expected<Client> client_ = Client::connect(server_.address());
};

struct StopAfter final : ProgressSink {
  explicit StopAfter(int rows) : left(rows) {}
  void report(const Progress& progress) override {
    on_calling_thread = on_calling_thread && std::this_thread::get_id() == caller;
    last_z_size = progress.z.size();
    if (--left == 0) source.request_stop();
  }
  int left;
  std::stop_source source;
  std::thread::id caller = std::this_thread::get_id();
  bool on_calling_thread = true;
  std::size_t last_z_size = 0;
};

TEST_F(ClientTest, AStopTokenGivesARunningSolveUp) {
  StopAfter sink(3);
  const auto answer = solve_long({&sink, sink.source.get_token(), {}});
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::cancelled);
  EXPECT_TRUE(sink.on_calling_thread);
  EXPECT_TRUE(server_becomes_idle());
}

TEST_F(ClientTest, AStopTokenGivesAUnarySolveUp) {
  std::stop_source source;
  std::thread stopper([&] {
    EXPECT_TRUE(eventually([this] { return client_->info()->running == 1; }));
    source.request_stop();
  });
  const auto answer = solve_long({nullptr, source.get_token(), {}});
  stopper.join();
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::cancelled);
  EXPECT_TRUE(server_becomes_idle());
}

TEST_F(ClientTest, AWarmStartGivesTheBitsThatItGivesInProcess) {
  examples::HopperParameters parameters{.steps = 10};
  const Solution last = solve_in_process(examples::hopper(parameters).view()).value();
  parameters = examples::advance(parameters, last.z);
  const OwnedProblem next = examples::hopper(parameters);
  const Solution start = examples::shift_hopper(last);
  const Solution here = solve_in_process(next.view(), {}, {.warm_start = &start}).value();
  ASSERT_TRUE(is_solved(here.status)) << here.detail;
  const auto there = client_->solve(next.view(), {}, {.warm_start = &start});
  ASSERT_TRUE(there.has_value()) << there.error().message();
  expect_same_bits(*there, here);
  const auto job = client_->jobs().submit(next.view(), {}, {.warm_start = &start});
  ASSERT_TRUE(job.has_value()) << job.error().message();
  expect_same_bits(client_->jobs().result(job->job_id, {.wait = true}).value(), here);
  EXPECT_LT(here.factorizations, client_->solve(next.view())->factorizations);
}

TEST_F(ClientTest, AWarmStartMayGoWhileASolveInProcessIsPending) {
  const OwnedProblem p = examples::hopper({.steps = 10});
  auto start = std::make_optional(solve_in_process(p.view()).value());
  const int factorizations = solve_in_process(p.view(), {}, {.warm_start = &*start})->factorizations;
  auto pending = Client::in_process().solve_async(p.view(), {}, {.warm_start = &*start});
  ASSERT_TRUE(pending.has_value()) << pending.error().message();
  std::ranges::fill(start->z, 1e9);
  start.reset();
  EXPECT_EQ(pending->get()->factorizations, factorizations);
}

TEST_F(ClientTest, AWarmStartThatDoesNotFitIsNamedAsTheCallerKnowsIt) {
  const OwnedProblem p = examples::hopper({.steps = 10});
  Solution start = solve_in_process(p.view()).value();
  start.complementarity_multipliers_R[3] = std::numeric_limits<double>::quiet_NaN();
  const Client here = Client::in_process();
  for (const Client* const client : {static_cast<const Client*>(&*client_), &here}) {
    EXPECT_EQ(client->solve(p.view(), {}, {.warm_start = &start}).error().message(),
              "warm_start.complementarity_multipliers_R[3] = nan: must be finite");
  }
}

TEST_F(ClientTest, ATokenThatIsStoppedAlreadyStartsNothing) {
  std::stop_source source;
  source.request_stop();
  const auto answer = client_->solve(example_.view(), {}, {nullptr, source.get_token(), {}});
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::cancelled);
}

TEST_F(ClientTest, TheDeadlineIsHard) {
  for (const double seconds : {0.2, 0.0, -1.0, -1e300}) {
    const auto answer = solve_long({}, {.deadline = std::chrono::duration<double>(seconds)});
    ASSERT_FALSE(answer.has_value());
    EXPECT_EQ(answer.error().code, ErrorCode::deadline_exceeded) << seconds;
  }
  EXPECT_TRUE(server_becomes_idle());
  EXPECT_TRUE(client_->solve(example_.view(), {}, {}, {.deadline = std::chrono::duration<double>(1e300)})
                  .has_value());
}

TEST_F(ClientTest, EventsReportTheJob) {
  std::string accepted;
  int position = -1;
  double queued = -1.0;
  CallControls call;
  call.accepted = [&](const std::string& id, int place, double wait_s) {
    accepted = id, position = place;
    EXPECT_GE(wait_s, 0.0);
  };
  call.started = [&](double queue_s) { queued = queue_s; };
  const auto answer = client_->solve(example_.view(), {}, {}, call);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_FALSE(accepted.empty());
  EXPECT_EQ(accepted, answer->job_id);
  EXPECT_EQ(position, 0);
  EXPECT_GE(queued, 0.0);
  EXPECT_GE(answer->total_s, answer->times.solve_s);
}

TEST_F(ClientTest, IteratesComeWhenAskedFor) {
  StopAfter sink(5);
  ASSERT_FALSE(solve_long({&sink, sink.source.get_token(), {}}, {.iterate_every = 1}).has_value());
  EXPECT_EQ(sink.last_z_size, 6000U);
}

TEST_F(ClientTest, NameAndRequestIdReachTheLog) {
  CallControls call;
  call.problem_name = "the problem \xff" + std::string(300, 'x');
  call.request_id = "request 17";
  ASSERT_TRUE(client_->solve(example_.view(), {}, {}, call).has_value());
  EXPECT_TRUE(eventually([this] { return !server_.log_lines({"request 17", "the problem ?xxx"}).empty(); }));
}

TEST_F(ClientTest, ARequestIdThatIsNoneIsRefusedHere) {
  for (const std::string& id : {std::string("a\nb"), std::string(129, 'x'), std::string("\xc3\xa4")}) {
    const auto answer = client_->solve(example_.view(), {}, {}, {.request_id = id});
    ASSERT_FALSE(answer.has_value());
    EXPECT_EQ(answer.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(answer.error().field, "request_id");
  }
}

TEST_F(ClientTest, AStreamsOwnFieldsAreCheckedToo) {
  StopAfter sink(1'000'000);
  const auto answer = client_->solve(example_.view(), {}, {&sink, {}, {}}, {.progress_interval_s = -1.0});
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().field, "progress_interval_s");
}

TEST_F(ClientTest, OneConnectionServesManyThreads) {
  std::vector<std::thread> threads;
  std::atomic<int> solved = 0;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, this] {
      for (int k = 0; k < 10; ++k) {
        const auto answer = client_->solve(example_.view());
        solved += answer && is_solved(answer->status) ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(solved, 40);
  EXPECT_EQ(client_->info()->solved, 40);
}

TEST_F(ClientTest, AServerThatIsGoneIsUnavailable) {
  EXPECT_TRUE(client_->healthy().value());
  server_.send(SIGKILL);
  server_.wait();
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(client_->solve(example_.view()).error().code, ErrorCode::unavailable);
    EXPECT_EQ(client_->healthy().error().code, ErrorCode::unavailable);
    EXPECT_EQ(client_->info().error().code, ErrorCode::unavailable);
  }
}

TEST_F(ClientTest, AQuestionToAFrozenServerCanBeGivenUp) {
  server_.send(SIGSTOP);
  std::stop_source stop;
  stop.request_stop();  // else the call's own deadline would end it
  EXPECT_EQ(client_->healthy(stop.get_token()).error().code, ErrorCode::cancelled);
  EXPECT_EQ(client_->info(stop.get_token()).error().code, ErrorCode::cancelled);
  EXPECT_EQ(client_->jobs().list({}, stop.get_token()).error().code, ErrorCode::cancelled);
  server_.send(SIGCONT);
}

TEST(ClientAddress, MustBeHostAndPortOrASocketsPath) {
  for (const char* address : {"127.0.0.1:50051", "localhost:1", "[::1]:65535", "unix:/a path/socket",
                              "unix:relative", "dns:///solver.example:443"})
    EXPECT_TRUE(Client::connect(address).has_value()) << address;
  for (const std::string& address :
       {std::string(), std::string("localhost"), std::string("localhost:0"), std::string("localhost:65536"),
        std::string("localhost:1x"), std::string(":1"), std::string("unix:"),
        "unix:" + std::string(200, 'x')}) {
    const auto client = Client::connect(address);
    ASSERT_FALSE(client.has_value()) << address;
    EXPECT_EQ(client.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(client.error().field, "address");
  }
}

// A caller's trace, as the client sends it along and hears of it.
const char* const kTraceId = "4bf92f3577b34da6a3ce929d0e0e4736";
const char* const kOther = "0af7651916cd43dd8448eb211c80319c";

class ClientTrace : public ::testing::Test {
 protected:
  static std::string span_in(const std::string& trace_id) {
    return "00-" + trace_id + "-00f067aa0ba902b7-01";
  }
  static Expected<Client> connect(const ServerProcess& server) {
    ConnectOptions options;
    options.traceparent = span_in(kTraceId);
    return Client::connect(server.address(), options);
  }
  /// The trace that a returned traceparent is of, if it has another span.
  static std::string trace_of(const std::string& returned) {
    return returned.size() == 55 && returned.find("00f067aa0ba902b7") == std::string::npos
               ? returned.substr(3, 32)
               : "none: " + returned;
  }
  [[nodiscard]] std::string trace_of_job(const std::string& id) const {
    return client_->jobs().get(id).value().job.trace_id;
  }

  OwnedProblem example_ = public_example().problem;
  ServerProcess server_{MARBLE_SERVER_BINARY};
  Expected<Client> client_ = connect(server_);
};

TEST_F(ClientTrace, GoesWithEverySolveAndComesBackWithItsAnswer) {
  const auto unary = client_->solve(example_.view());
  ASSERT_TRUE(unary);
  EXPECT_EQ(trace_of(unary->traceparent), kTraceId);
  EXPECT_EQ(trace_of_job(unary->job_id), kTraceId);
  CallControls call;
  call.traceparent = span_in(kOther);  // one of its own
  call.started = [](double) {};
  const auto streamed = client_->solve(example_.view(), {}, {}, call);
  ASSERT_TRUE(streamed);
  EXPECT_EQ(trace_of(streamed->traceparent), kOther);
  EXPECT_EQ(trace_of_job(streamed->job_id), kOther);
}

TEST_F(ClientTrace, GoesWithSubmissionsBatchesAndSessions) {
  const auto submitted = client_->jobs().submit(example_.view());
  ASSERT_TRUE(submitted);
  EXPECT_EQ(trace_of(submitted->traceparent), kTraceId);
  EXPECT_EQ(trace_of_job(submitted->job_id), kTraceId);
  const BatchProblem one{1, example_.view()};
  const auto sink = [&](std::int64_t, const Expected<RemoteSolution>& answer) {
    ASSERT_TRUE(answer);
    EXPECT_EQ(trace_of(answer->traceparent), kOther);
    EXPECT_EQ(trace_of_job(answer->job_id), kOther);
  };
  BatchControls controls;
  controls.traceparent = span_in(kOther);
  EXPECT_TRUE(client_->solve_batch(std::span(&one, 1), sink, controls));
  auto session = client_->open_session(example_.view());
  ASSERT_TRUE(session);
  EXPECT_EQ(trace_of(session->traceparent()), kTraceId);
  EXPECT_EQ(trace_of_job(session->job_id()), kTraceId);
  EXPECT_EQ(session->solve().value().traceparent, session->traceparent());
}

TEST_F(ClientTrace, WhatCannotBeSentIsAnErrorAndWhatIsNoneIsIgnored) {
  CallControls call;
  call.traceparent = "two\nlines";
  const auto refused = client_->solve(example_.view(), {}, {}, call);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "traceparent");
  ConnectOptions options;
  options.traceparent = call.traceparent;
  EXPECT_EQ(Client::connect(server_.address(), options).error().field, "traceparent");
  call.traceparent = "no trace";
  const auto answer = client_->solve(example_.view(), {}, {}, call);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->traceparent, "");
}

}  // namespace
}  // namespace marble::testing
