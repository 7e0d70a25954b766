// Several clients on one server: priorities, turns, quotas, and what each may see and end.
#include <algorithm>

#include "marble/convert.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "secure_service_test.h"

namespace marble::testing {
namespace {

class Sharing : public SecureServiceTest {
 protected:
  void start(const std::vector<std::string>& flags = {}) {
    ServiceTest::start(flags);
    jobs_ = v1::Jobs::NewStub(channel());
  }
  static void add(const Metadata& metadata, grpc::ClientContext& context) {
    for (const auto& [key, value] : metadata) context.AddMetadata(key, value);
  }
  static Metadata name(const std::string& client) { return {{"marble-client", client}}; }
  static v1::SolveRequest with(v1::Priority priority, v1::SolveRequest request = example_request()) {
    request.set_priority(priority);
    return request;
  }

  struct Submitted {
    grpc::Status status;
    v1::SubmitResponse response;
    [[nodiscard]] const std::string& id() const { return response.job_id(); }
  };
  Submitted submit(const Metadata& caller, const v1::SolveRequest& request) {
    grpc::ClientContext context;
    add(caller, context);
    Submitted submitted;
    submitted.status = jobs_->Submit(&context, request, &submitted.response);
    return submitted;
  }
  grpc::Status cancel(const Metadata& caller, const std::string& id) {
    grpc::ClientContext context;
    add(caller, context);
    v1::CancelJobRequest request;
    request.set_job_id(id);
    v1::CancelJobResponse response;
    return jobs_->Cancel(&context, request, &response);
  }
  grpc::Status get(const Metadata& caller, const std::string& id) {
    grpc::ClientContext context;
    add(caller, context);
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::GetJobResponse response;
    return jobs_->Get(&context, request, &response);
  }
  grpc::Status result(const Metadata& caller, const std::string& id) {
    grpc::ClientContext context;
    add(caller, context);
    v1::JobResultRequest request;
    request.set_job_id(id);
    request.set_wait(true);
    v1::SolveResponse response;
    return jobs_->Result(&context, request, &response);
  }
  std::vector<v1::JobInfo> list(const Metadata& caller) {
    grpc::ClientContext context;
    add(caller, context);
    v1::ListJobsResponse response;
    EXPECT_TRUE(jobs_->List(&context, {}, &response).ok());
    return {response.jobs().begin(), response.jobs().end()};
  }
  /// Keeps the only worker busy until it is cancelled.
  std::string block() {
    const Submitted blocker = submit(name("blocker"), long_request());
    EXPECT_TRUE(eventually([&] { return counters().running() == 1; }));
    return blocker.id();
  }
  /// Ends the blocker and reports in which order the others were taken.
  std::vector<std::string> order_after(const std::string& blocker) {
    EXPECT_TRUE(cancel(name("blocker"), blocker).ok());
    EXPECT_TRUE(eventually_idle());
    std::vector<std::pair<double, std::string>> started;
    for (const v1::JobInfo& job : list({})) {
      if (job.job_id() != blocker)
        started.emplace_back(job.accepted_unix_s() + job.times().queue_s(), job.request_id());
    }
    std::sort(started.begin(), started.end());
    std::vector<std::string> order;
    for (const auto& [at, id] : started) order.push_back(id);
    return order;
  }
  static v1::SolveRequest tagged(const std::string& id, v1::Priority priority = v1::PRIORITY_UNSPECIFIED) {
    v1::SolveRequest request = with(priority);
    request.set_request_id(id);
    return request;
  }

  std::unique_ptr<v1::Jobs::Stub> jobs_;
};

TEST_F(Sharing, HigherPrioritiesGoFirstAndThePlaceIsReportedAsItWillBe) {
  start({"--workers", "1"});
  const std::string blocker = block();
  EXPECT_EQ(submit(name("a"), tagged("batch", v1::PRIORITY_BATCH)).response.queue_position(), 0);
  const Submitted interactive = submit(name("a"), tagged("interactive"));
  EXPECT_EQ(interactive.response.queue_position(), 0) << "before the batch";
  EXPECT_EQ(submit(name("a"), tagged("realtime", v1::PRIORITY_REALTIME)).response.queue_position(), 0);
  EXPECT_EQ(submit(name("a"), tagged("realtime 2", v1::PRIORITY_REALTIME)).response.queue_position(), 1);
  EXPECT_EQ(order_after(blocker),
            (std::vector<std::string>{"realtime", "realtime 2", "interactive", "batch"}));
}

TEST_F(Sharing, AFloodingClientDoesNotKeepOthersWaiting) {
  start({"--workers", "1"});
  const std::string blocker = block();
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(submit(name("flood"), tagged("flood " + std::to_string(i))).status.ok());
  ASSERT_TRUE(submit(name("quiet"), tagged("quiet")).status.ok());
  EXPECT_EQ(order_after(blocker),
            (std::vector<std::string>{"flood 0", "quiet", "flood 1", "flood 2", "flood 3"}));
}

TEST_F(Sharing, TheStreamReportsWhenThePlaceChanges) {
  start({"--workers", "1"});
  const std::string blocker = block();
  const Submitted ahead = submit(name("a"), long_request());
  Stream stream(solver(), long_request());
  const auto accepted = stream.next();
  ASSERT_TRUE(accepted && accepted->has_accepted());
  EXPECT_EQ(accepted->accepted().queue_position(), 1);
  EXPECT_TRUE(cancel(name("a"), ahead.id()).ok());
  const auto queued = stream.next();
  ASSERT_TRUE(queued && queued->has_queued());
  EXPECT_EQ(queued->queued().queue_position(), 0);
}

TEST_F(Sharing, QuotasHangOnTheName) {
  const std::string file = write("config.toml",
                                 "client_queued = 2\n"
                                 "[clients.small]\nrunning = 1\nqueued = 1\npriority = \"interactive\"\n");
  start({"--workers", "2", "--config", file});
  const Submitted running = submit(name("small"), long_request());
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  const Submitted waiting = submit(name("small"), long_request());
  EXPECT_TRUE(waiting.status.ok());
  const Submitted refused = submit(name("small"), example_request());
  EXPECT_EQ(refused.status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(refused.status.error_message().find("\"small\""), std::string::npos)
      << refused.status.error_message();
  EXPECT_TRUE(retry_info(refused.status).has_value());
  v1::SolveResponse response;
  EXPECT_TRUE(solve(example_request(), &response).ok()) << "the other worker is free for other clients";
  EXPECT_EQ(counters().running(), 1) << "and only for them";
  const Submitted high = submit(name("small"), with(v1::PRIORITY_REALTIME));
  EXPECT_EQ(high.status.error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(submit(name("other"), with(static_cast<v1::Priority>(9))).status.error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(Sharing, FurtherStartsGiveTheSameAnswerWhateverTheLoad) {
  v1::SolveRequest request;
  const OwnedProblem p = examples::hopper({.steps = 24});
  to_message(p.view(), request.mutable_problem());
  request.mutable_options()->set_num_starts(5);
  Options options;
  options.num_starts = 5;
  const Solution alone = solve_in_process(p.view(), options).value();
  start({"--workers", "3"});
  const auto ask = [&] {
    v1::SolveResponse response;
    EXPECT_TRUE(solve(request, &response).ok());
    const auto& z = response.solution().z();
    EXPECT_EQ(std::vector<double>(z.begin(), z.end()), alone.z);
  };
  ask();
  const Submitted one = submit(name("a"), long_request()), two = submit(name("b"), long_request());
  ASSERT_TRUE(eventually([&] { return counters().running() == 2; }));
  ask();
  EXPECT_TRUE(cancel(name("a"), one.id()).ok());
  EXPECT_TRUE(cancel(name("b"), two.id()).ok());
}

TEST_F(Sharing, RolesSayWhoSeesAndEndsWhat) {
  const Token alice = new_token("alice:solve"), bob = new_token("bob:solve");
  const Token eye = new_token("eye:observe"), root = new_token("root:admin");
  const std::string file = write("tokens", alice.line + bob.line + eye.line + root.line);
  start({"--workers", "2", "--tokens", file});
  const Metadata as_alice = bearer(alice.secret), as_bob = bearer(bob.secret);
  const Metadata as_eye = bearer(eye.secret), as_root = bearer(root.secret);
  const Submitted job = submit(as_alice, long_request());
  ASSERT_TRUE(job.status.ok()) << job.status.error_message();
  EXPECT_EQ(submit(as_eye, example_request()).status.error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(submit(bearer("wrong"), example_request()).status.error_code(),
            grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(submit({}, example_request()).status.error_code(), grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(list(as_alice).size(), 1U);
  EXPECT_EQ(list(as_alice)[0].client(), "alice");
  EXPECT_EQ(list(as_bob).size(), 0U);
  EXPECT_EQ(list(as_eye).size(), 1U);
  EXPECT_TRUE(get(as_alice, job.id()).ok());
  EXPECT_EQ(get(as_bob, job.id()).error_code(), grpc::StatusCode::NOT_FOUND) << "not even that there is one";
  EXPECT_EQ(cancel(as_bob, job.id()).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(cancel(as_eye, job.id()).error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(result(as_eye, job.id()).error_code(), grpc::StatusCode::NOT_FOUND)
      << "answers are their client's";
  EXPECT_TRUE(cancel(as_root, job.id()).ok());
  EXPECT_TRUE(result(as_alice, job.id()).ok());
  EXPECT_TRUE(eventually([&] {
    return !server().log_lines({"client=\"alice\"", "status=\"cancelled\""}).empty();
  }));
}

TEST_F(Sharing, EverySolvingCallAsksForTheRole) {
  const Token eye = new_token("eye:observe");
  start({"--tokens", write("tokens", eye.line)});
  for (const auto& [caller, expected] :
       {std::pair{Metadata{}, grpc::StatusCode::UNAUTHENTICATED},
        std::pair{bearer(eye.secret), grpc::StatusCode::PERMISSION_DENIED}}) {
    grpc::ClientContext unary, stream, batch, session;
    for (grpc::ClientContext* context : {&unary, &stream, &batch, &session}) add(caller, *context);
    v1::SolveResponse response;
    EXPECT_EQ(solver().Solve(&unary, example_request(), &response).error_code(), expected);
    v1::SolveStreamRequest streamed;
    *streamed.mutable_solve() = example_request();
    EXPECT_EQ(solver().SolveStream(&stream, streamed)->Finish().error_code(), expected);
    EXPECT_EQ(solver().SolveBatch(&batch)->Finish().error_code(), expected);
    EXPECT_EQ(solver().Session(&session)->Finish().error_code(), expected);
  }
}

TEST_F(Sharing, AProblemThatNeedsTooMuchMemoryIsRefusedInWords) {
  start({"--solve-bytes", "1048576"});
  v1::SolveResponse response;
  const grpc::Status refused = solve(long_request(), &response);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(refused.error_message().find("1048576"), std::string::npos) << refused.error_message();
  EXPECT_FALSE(retry_info(refused).has_value()) << "waiting does not help";
  EXPECT_TRUE(solve(example_request(), &response).ok());
}

}  // namespace
}  // namespace marble::testing
