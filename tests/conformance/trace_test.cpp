// A caller's trace, as the client sends it along and hears of it.
#include <gtest/gtest.h>

#include "marble/client.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

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
