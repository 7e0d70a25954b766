// Jobs by their ids: submitted, listed, watched, cancelled, fetched and let go.
#include <cmath>
#include <set>
#include <thread>

#include "bidi.h"
#include "jobs_client.h"

namespace marble::testing {
namespace {

class Jobs : public JobsServiceTest {
 protected:
  v1::ListJobsResponse list(const v1::ListJobsRequest& request = {}) {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    const grpc::Status status = jobs().List(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }
  struct Watch {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::WatchJobsResponse>> reader;
    std::optional<v1::WatchJobsResponse> next() {
      v1::WatchJobsResponse response;
      if (!reader->Read(&response)) return std::nullopt;
      return response;
    }
    grpc::Status finish() {
      while (next()) {
      }
      if (!status) status = reader->Finish();
      return *status;
    }
    ~Watch() {
      context.TryCancel();
      (void)finish();
    }
    std::optional<grpc::Status> status;
  };
  std::unique_ptr<Watch> watch(const std::string& id) {
    auto call = std::make_unique<Watch>();
    v1::WatchJobsRequest request;
    request.set_job_id(id);
    call->reader = jobs().Watch(&call->context, request);
    return call;
  }
};

TEST_F(Jobs, AnInfeasibleSolveReportsItsConflictAlthoughItsAnswerIsNotKept) {
  start();
  v1::SolveRequest request = example_request();
  v1::Problem& problem = *request.mutable_problem();  // z1 = 1, and 3 z1 >= 6
  problem.mutable_inequality_matrix()->Clear();
  problem.mutable_inequality_matrix()->set_rows(1);
  problem.mutable_inequality_matrix()->set_columns(4);
  for (const int pointer : {0, 1, 1, 1, 1}) problem.mutable_inequality_matrix()->add_column_pointers(pointer);
  problem.mutable_inequality_matrix()->add_row_indices(0);
  problem.mutable_inequality_matrix()->add_values(3.0);
  problem.clear_inequality_offset();
  problem.add_inequality_offset(-6.0);
  for (const bool explain : {false, true}) {
    request.mutable_options()->set_explain(explain);
    grpc::ClientContext context;
    v1::SolveResponse response;
    ASSERT_TRUE(solver().Solve(&context, request, &response).ok());
    ASSERT_EQ(response.solution().status(), v1::STATUS_INFEASIBLE);
    const v1::Infeasibility why = get(response.job_id()).infeasibility();
    ASSERT_EQ(why.rows_size(), 2) << why.DebugString();
    EXPECT_EQ(std::abs(why.multipliers(0)), std::abs(response.solution().certificate(why.rows(0))));
    EXPECT_EQ(why.has_conflict(), explain);
    EXPECT_EQ(why.conflict().equalities_size() + why.conflict().inequalities_size(), explain ? 2 : 0);
    EXPECT_EQ(why.conflict().minimal(), explain);
  }
  EXPECT_FALSE(get(submit(example_request())).has_infeasibility());
}

TEST_F(Jobs, ASubmittedJobsAnswerIsThereForWhoeverComesBack) {
  start();
  const std::string id = submit(example_request());
  v1::SolveResponse response;
  ASSERT_TRUE(result(id, true, &response).ok());
  EXPECT_EQ(response.job_id(), id);
  EXPECT_NEAR(response.solution().objective(), 3.0, 1e-9);
  v1::SolveResponse again;
  ASSERT_TRUE(result(id, false, &again).ok()) << "as often as it is asked for";
  EXPECT_GT(get(id).job().result_bytes(), 0);
  EXPECT_TRUE(remove(id).ok());
  EXPECT_EQ(result(id, false, &again).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(remove(id).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(counters().result_bytes(), 0);
}

TEST_F(Jobs, AJobThatIsOverReportsWhyAndHowItsPairsClosedOnTheCorner) {
  start();
  const std::string id = submit(example_request());
  v1::SolveResponse response;
  ASSERT_TRUE(result(id, true, &response).ok());
  const v1::GetJobResponse known = get(id);
  EXPECT_EQ(known.job().detail(), response.solution().detail());
  EXPECT_FALSE(known.job().detail().empty());
  EXPECT_GE(known.job().finished_unix_s(), known.job().accepted_unix_s());
  EXPECT_GE(known.job().times().polish_s(), 0.0);
  ASSERT_GT(known.trace().pairs_size(), 1);
  const v1::PairSides& last = known.trace().pairs(known.trace().pairs_size() - 1);
  EXPECT_EQ(last.iteration(), known.trace().rows(known.trace().rows_size() - 1).iteration());
  ASSERT_EQ(last.s_size(), 1);
  ASSERT_EQ(last.t_size(), 1);
  EXPECT_NEAR(std::min(last.s(0), last.t(0)), known.job().violations().complementarity(), 0.1);
}

TEST_F(Jobs, NoPairsAreKeptWhereTheServerIsReportedSo) {
  start({"--trace-pairs", "0"});
  const std::string id = submit(example_request());
  v1::SolveResponse response;
  ASSERT_TRUE(result(id, true, &response).ok());
  EXPECT_GT(get(id).trace().rows_size(), 0);
  EXPECT_EQ(get(id).trace().pairs_size(), 0);
}

TEST_F(Jobs, AJobThatRunsHasNoAnswerYetAndWaitingHasItsDeadline) {
  start();
  const std::string id = submit(long_request());
  v1::SolveResponse response;
  EXPECT_EQ(result(id, false, &response).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(result(id, true, &response, std::chrono::milliseconds(200)).error_code(),
            grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_TRUE(cancel(id).ok());
  ASSERT_TRUE(result(id, true, &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_CANCELLED) << "with its best iterate";
}

TEST_F(Jobs, DeletingAJobStopsItAndWhoWaitsIsReported) {
  start();
  const std::string id = submit(long_request());
  grpc::Status waited;
  std::thread waiter([&] {
    v1::SolveResponse response;
    waited = result(id, true, &response);
  });
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  std::this_thread::sleep_for(
      std::chrono::milliseconds(50));  // most likely it waits by now; either way is right
  EXPECT_TRUE(remove(id).ok());
  waiter.join();
  EXPECT_EQ(waited.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_TRUE(eventually_idle());
  (void)get(id, grpc::StatusCode::NOT_FOUND);
}

TEST_F(Jobs, AJobThatFailsAnswersWithItsError) {
  start({"--solve-bytes", "1048576"});
  const std::string id = submit(long_request());
  v1::SolveResponse response;
  const grpc::Status status = result(id, true, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(status.error_message().find("bytes"), std::string::npos) << status.error_message();
  EXPECT_EQ(get(id).job().error().code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_GT(get(id).job().finished_unix_s(), 0.0);
}

TEST_F(Jobs, AnswersAreKeptForABoundedTimeAndSize) {
  start({"--result-keep-s", "1"});
  const std::string id = submit(example_request());
  ASSERT_TRUE(eventually([&] { return get(id).job().state() == v1::JOB_STATE_FINISHED; }));
  v1::SolveResponse response;
  EXPECT_TRUE(
      eventually([&] { return result(id, false, &response).error_code() == grpc::StatusCode::NOT_FOUND; }));
  EXPECT_EQ(counters().result_bytes(), 0);
}

TEST_F(Jobs, AreListedNewestFirstByStateInPages) {
  start({"--workers", "1"});
  const std::string done = submit(example_request());
  v1::SolveResponse response;
  ASSERT_TRUE(result(done, true, &response).ok());
  const std::string running = submit(long_request());
  ASSERT_TRUE(eventually([&] { return get(running).job().memory_bytes() > 0; }));
  v1::SolveRequest named = example_request();
  named.set_request_id("mine");
  named.set_priority(v1::PRIORITY_BATCH);
  const std::string waiting = submit(named);
  const auto all = list();
  ASSERT_EQ(all.jobs_size(), 3);
  EXPECT_EQ(all.jobs(0).job_id(), waiting);
  EXPECT_EQ(all.jobs(0).state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(all.jobs(0).request_id(), "mine");
  EXPECT_EQ(all.jobs(0).priority(), v1::PRIORITY_BATCH);
  EXPECT_EQ(all.jobs(0).kind(), v1::JOB_KIND_SUBMITTED);
  EXPECT_EQ(all.jobs(0).variables(), 4);
  EXPECT_GT(all.jobs(0).times().queue_s(), 0.0) << "it waits, and grows older";
  EXPECT_GT(all.jobs(1).times().total_s(), 0.0);
  EXPECT_EQ(all.jobs(1).job_id(), running);
  EXPECT_EQ(all.jobs(1).state(), v1::JOB_STATE_RUNNING);
  EXPECT_EQ(all.jobs(2).job_id(), done);
  EXPECT_EQ(all.jobs(2).status(), v1::STATUS_SOLVED);
  EXPECT_NEAR(all.jobs(2).objective(), 3.0, 1e-9);
  v1::ListJobsRequest page;
  page.set_limit(1);
  EXPECT_TRUE(list(page).more());
  page.set_before_job_id(waiting);
  EXPECT_EQ(list(page).jobs(0).job_id(), running);
  v1::ListJobsRequest finished;
  finished.add_states(v1::JOB_STATE_FINISHED);
  EXPECT_EQ(list(finished).jobs_size(), 1);
  v1::ListJobsRequest of_another;
  of_another.set_client("another");
  EXPECT_EQ(list(of_another).jobs_size(), 0);
}

TEST_F(Jobs, OnlySoManyFinishedOnesAreRemembered) {
  start({"--history-jobs", "3"});
  std::vector<std::string> ids;
  v1::SolveResponse response;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(solve(example_request(), &response).ok());
    ids.push_back(response.job_id());
  }
  EXPECT_TRUE(eventually([&] { return list().jobs_size() == 3; }));
  (void)get(ids[0], grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(get(ids[4]).job().state(), v1::JOB_STATE_FINISHED);
}

TEST_F(Jobs, ALongSolvesTraceIsThinnedEvenlyToItsBound) {
  start({"--trace-rows", "40"});
  v1::SolveResponse response;
  ASSERT_TRUE(solve(long_request(1000), &response).ok());
  const v1::GetJobResponse job = get(response.job_id());
  const auto& rows = job.trace().rows();
  ASSERT_GE(rows.size(), 20);
  ASSERT_LE(rows.size(), 41);
  for (int i = 0; i + 2 < rows.size(); ++i)
    EXPECT_EQ(rows[i + 1].iteration() - rows[i].iteration(), job.trace().stride()) << "row " << i;
  EXPECT_EQ(rows[rows.size() - 1].iteration(), response.solution().iterations()) << "the newest is there";
  EXPECT_EQ(job.options().max_iterations(), 1000);
}

TEST_F(Jobs, CancellingAWaitingJobAnswersItsCaller) {
  start({"--workers", "1"});
  const std::string running = submit(long_request());
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  const std::string waiting = submit(example_request());
  EXPECT_TRUE(cancel(waiting).ok());
  v1::SolveResponse response;
  EXPECT_EQ(result(waiting, true, &response).error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(cancel(running).ok());
  EXPECT_EQ(cancel("nosuchjob").error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(Jobs, WhoeverWatchesAJobSeesItFromItsBeginningToItsEnd) {
  start();
  const std::string id = submit(long_request(400));
  const auto call = watch(id);
  int rows = 0;
  std::int64_t skipped = 0;
  v1::JobInfo last;
  while (const auto response = call->next()) {
    ASSERT_EQ(response->events_size(), 1);
    rows += response->events(0).rows_size() +
            response->events(0).trace().rows_size() * response->events(0).trace().stride();
    skipped = response->skipped();
    last = response->events(0).job();
  }
  EXPECT_EQ(last.job_id(), id);
  EXPECT_EQ(last.state(), v1::JOB_STATE_FINISHED);
  EXPECT_EQ(last.status(), v1::STATUS_ITERATION_LIMIT);
  EXPECT_GE(rows + skipped, 390) << "every row, or reported as skipped";
  v1::SolveResponse response;
  EXPECT_TRUE(result(id, false, &response).ok()) << "the answer is there when the watch says so";
}

TEST_F(Jobs, AWatchOfAllReportsOfEveryJob) {
  start();
  const auto call = watch("");
  call->reader->WaitForInitialMetadata();  // it watches from now on
  std::vector<std::string> ids;
  v1::SolveResponse response;
  for (int i = 0; i < 30; ++i) {
    ASSERT_TRUE(solve(example_request(), &response).ok());
    ids.push_back(response.job_id());
  }
  std::set<std::string> finished;
  while (finished.size() < ids.size()) {
    const auto events = call->next();
    ASSERT_TRUE(events.has_value());
    for (const auto& event : events->events()) {
      if (event.job().state() == v1::JOB_STATE_FINISHED) finished.insert(event.job().job_id());
    }
  }
  for (const std::string& id : ids) EXPECT_TRUE(finished.contains(id));
}

TEST_F(Jobs, ASessionIsOneJobForAllItsUpdates) {
  start();
  Bidi<v1::SessionRequest, v1::SessionResponse> session(
      [this](grpc::ClientContext* context) { return solver().Session(context); });
  v1::SessionRequest setup;
  *setup.mutable_setup()->mutable_problem() = example_request().problem();
  session.write(setup);
  const std::string id = session.next()->ready().job_id();
  for (int i = 1; i <= 3; ++i) {
    v1::SessionRequest update;
    update.mutable_update()->set_sequence(i);
    session.write(update);
    ASSERT_TRUE(session.next()->has_answer());
  }
  const v1::JobInfo job = get(id).job();
  EXPECT_EQ(job.kind(), v1::JOB_KIND_SESSION);
  EXPECT_EQ(job.state(), v1::JOB_STATE_IDLE);
  EXPECT_EQ(job.updates(), 3);
  EXPECT_GT(job.memory_bytes(), 0);
  EXPECT_TRUE(cancel(id).ok());
  EXPECT_EQ(session.finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(get(id).job().state(), v1::JOB_STATE_FINISHED);
}

TEST_F(Jobs, WatchersAreLimited) {
  start({"--watchers", "1"});
  const std::string id = submit(long_request());
  const auto first = watch(id);
  ASSERT_TRUE(first->next().has_value());
  const auto second = watch(id);
  EXPECT_EQ(second->finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

// The other job keeps the server from leaving before the first one's answer is fetched.
TEST_F(Jobs, ADrainFinishesSubmittedJobsAndGivesTheirAnswers) {
  start({"--workers", "2", "--drain-grace-s", "3600"});
  const std::string other = submit(long_request());
  const std::string id = submit(long_request(300));
  server().terminate();
  ASSERT_TRUE(eventually([&] { return health() == "NOT_SERVING"; }));
  v1::SolveResponse response;
  const grpc::Status waited = result(id, true, &response);
  EXPECT_TRUE(waited.ok()) << waited.error_message();
  EXPECT_EQ(response.solution().status(), v1::STATUS_ITERATION_LIMIT) << "it ran to its own end";
  EXPECT_TRUE(cancel(other).ok());
  EXPECT_EQ(server().wait(), 0);
}

}  // namespace
}  // namespace marble::testing
