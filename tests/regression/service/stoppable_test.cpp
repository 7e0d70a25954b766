// Symptom: one request of 0.9 MB (n = 11,000, a random sparse Q) that its client had cancelled held a worker
// for 58 s; SIGTERM with a grace of 3 s, and a second one, ended the server after 34 s; GetInfo reported
// others that they would wait for 0.000 s meanwhile. A time limit of 1 s did not help either.
//
// Within one factorization nothing looked at the stop token or the clock, and the estimate knew of the mean
// of past solves alone.
#include "marble/convert.h"
#include "service_test.h"
#include "support/random_problem.h"

namespace marble::testing {
namespace {

class Stoppable : public ServiceTest {
 protected:
  static v1::SolveRequest filling_request(double time_limit_s = 0.0) {
    v1::SolveRequest request;
    to_message(filling_problem(32'000).view(), request.mutable_problem());
    if (time_limit_s > 0.0) request.mutable_options()->set_time_limit_s(time_limit_s);
    return request;
  }
  // Its memory is known when its set-up is done: what follows is the factorization.
  bool factorizes() {
    const auto jobs = v1::Jobs::NewStub(channel());
    return eventually([&] {
      grpc::ClientContext context;
      v1::ListJobsResponse list;
      return jobs->List(&context, {}, &list).ok() && list.jobs_size() > 0 && list.jobs(0).memory_bytes() > 0;
    });
  }
};

TEST_F(Stoppable, ACancelledFactorizationFreesItsWorker) {
  start({"--workers", "1"});
  Stream running(solver(), filling_request());
  ASSERT_TRUE(factorizes());
  running.cancel();
  EXPECT_TRUE(eventually_idle());
  EXPECT_EQ(counters().cancelled_total(), 1);
  EXPECT_TRUE(lives());
}

TEST_F(Stoppable, OthersAreReportedThatTheyWillWait) {
  start({"--workers", "1"});
  Stream running(solver(), filling_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  const double at_first = counters().estimated_wait_realtime_s();
  EXPECT_TRUE(eventually([&] { return counters().estimated_wait_realtime_s() > at_first + 0.1; }))
      << "only its own time shows how long it takes";
  running.cancel();
  EXPECT_TRUE(eventually([&] { return counters().estimated_wait_realtime_s() == 0.0; }));
}

TEST_F(Stoppable, TheEndOfADrainsGraceEndsAFactorization) {
  start({"--workers", "1", "--drain-grace-s", "0"});
  Stream running(solver(), filling_request());
  ASSERT_TRUE(factorizes());
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Stoppable, ASecondSignalEndsAFactorization) {
  start({"--workers", "1", "--drain-grace-s", "3600"});
  Stream running(solver(), filling_request());
  ASSERT_TRUE(factorizes());
  server().terminate();
  ASSERT_TRUE(eventually([&] { return health() == "NOT_SERVING"; }));
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
}

// Too short for the factorization on any machine, and long enough for what comes before it on this one.
constexpr double kLimitS = 2.0;

TEST_F(Stoppable, AFactorizationThatIsTooLongIsRefusedAndNotWorthARetry) {
  start({"--workers", "1"});
  v1::SolveResponse response;
  grpc::Status refused = solve(filling_request(kLimitS), &response);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(refused.error_message().find("flops"), std::string::npos) << refused.error_message();
  EXPECT_NE(refused.error_message().find("the time limit of 2 s"), std::string::npos)
      << refused.error_message();
  EXPECT_FALSE(retry_info(refused).has_value());
  EXPECT_TRUE(lives());
}

TEST_F(Stoppable, TheServersOwnLimitIsReported) {
  start({"--workers", "1", "--solve-seconds", "2"});
  v1::SolveResponse response;
  const grpc::Status refused = solve(filling_request(), &response);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(refused.error_message().find("the limit for one of 2 s"), std::string::npos)
      << refused.error_message();
}

}  // namespace
}  // namespace marble::testing
