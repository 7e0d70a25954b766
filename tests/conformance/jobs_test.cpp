// Jobs by their ids: submitted here, fetched, watched and ended from elsewhere.
#include "marble/jobs.h"

#include <gtest/gtest.h>

#include <future>

#include "marble/client.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "problems.h"
#include "support/losing_relay.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

class JobsTest : public ::testing::Test {
 protected:
  std::string submit_long() {
    const v1::SolveRequest request = long_request();
    const auto job = jobs_.submit(view_of(request.problem()), options_of(request.options()).value(), {},
                                  {.problem_name = "long"});
    EXPECT_TRUE(job.has_value());
    return job ? job->job_id : "";
  }
  [[nodiscard]] bool comes_to(const std::string& id, JobState state) const {
    return eventually([&] { return jobs_.get(id)->job.state == state; });
  }

  OwnedProblem example_ = public_example().problem;
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "1"}};
  Jobs jobs_ = Client::connect(server_.address())->jobs();
};

TEST_F(JobsTest, ASubmittedJobsAnswerIsThereForAnotherConnection) {
  std::string id;
  {
    const auto client = Client::connect(server_.address());
    const auto job = client->jobs().submit(example_.view(), {}, {}, {.priority = Priority::batch});
    ASSERT_TRUE(job.has_value()) << job.error().message();
    id = job->job_id;
  }
  const auto answer = jobs_.result(id, {.wait = true});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->z, solve_in_process(example_.view())->z);
  EXPECT_EQ(answer->job_id, id);
  EXPECT_EQ(jobs_.get(id)->job.priority, Priority::batch);
}

TEST_F(JobsTest, ASubmissionWhoseAnswerGotLostIsSentAgainAndIsOneJob) {
  const OwnedProblem large = examples::hopper({.steps = 10});
  LosingRelay relay(server_.address());
  const Jobs far = Client::connect(relay.address())->jobs();
  auto submitted = std::async(std::launch::async, [&] { return far.submit(large.view()); });
  EXPECT_TRUE(eventually([&] { return !jobs_.list()->jobs.empty(); }));
  relay.cut();
  const auto job = submitted.get();
  ASSERT_TRUE(job.has_value()) << job.error().message();
  const auto all = jobs_.list()->jobs;
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].job_id, job->job_id);
  EXPECT_TRUE(is_solved(jobs_.result(job->job_id, {.wait = true})->status));
}

TEST_F(JobsTest, AnUnfinishedJobHasNoAnswerYet) {
  const std::string id = submit_long();
  EXPECT_EQ(jobs_.result(id).error().code, ErrorCode::failed_precondition);
  const auto late = jobs_.result(id, {.wait = true, .deadline = std::chrono::duration<double>(0.1)});
  EXPECT_EQ(late.error().code, ErrorCode::deadline_exceeded);
  std::stop_source source;
  source.request_stop();
  EXPECT_EQ(jobs_.result(id, {.wait = true, .stop = source.get_token()}).error().bound,
            "cancelled by the caller");
}

TEST_F(JobsTest, ACancelledJobGivesItsBestIterate) {
  const std::string id = submit_long();
  ASSERT_TRUE(comes_to(id, JobState::running));
  ASSERT_TRUE(jobs_.cancel(id).has_value());
  const auto answer = jobs_.result(id, {.wait = true});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->status, Status::cancelled);
  EXPECT_EQ(answer->z.size(), 6000U);
}

TEST_F(JobsTest, ARemovedJobIsGone) {
  const auto job = jobs_.submit(example_.view());
  ASSERT_TRUE(jobs_.result(job->job_id, {.wait = true}).has_value());
  ASSERT_TRUE(jobs_.remove(job->job_id).has_value());
  EXPECT_EQ(jobs_.result(job->job_id).error().code, ErrorCode::not_found);
  EXPECT_EQ(jobs_.remove(job->job_id).error().code, ErrorCode::not_found);
  EXPECT_EQ(jobs_.get(job->job_id).error().code, ErrorCode::not_found);
}

TEST_F(JobsTest, ListsByStateNewestFirstAndInPages) {
  const std::string running = submit_long();
  ASSERT_TRUE(comes_to(running, JobState::running));
  std::vector<std::string> waiting;
  for (int i = 0; i < 3; ++i) waiting.push_back(jobs_.submit(example_.view())->job_id);
  const auto all = jobs_.list();
  ASSERT_TRUE(all.has_value());
  ASSERT_EQ(all->jobs.size(), 4U);
  EXPECT_EQ(all->jobs.front().job_id, waiting.back());
  EXPECT_EQ(all->jobs.back().problem_name, "long");
  EXPECT_EQ(all->jobs.back().variables, 6000);
  EXPECT_EQ(jobs_.list({.states = {JobState::running}})->jobs.size(), 1U);
  EXPECT_EQ(jobs_.list({.client = "nobody"})->jobs.size(), 0U);
  const auto page = jobs_.list({.limit = 2});
  EXPECT_TRUE(page->more);
  const auto rest = jobs_.list({.limit = 2, .before_job_id = page->jobs.back().job_id});
  EXPECT_FALSE(rest->more);
  EXPECT_EQ(rest->jobs.back().job_id, running);
  EXPECT_EQ(jobs_.list({.limit = -1}).error().field, "limit");
}

TEST_F(JobsTest, AJobReportsItsOptionsAndItsTrace) {
  Options options;
  options.max_iterations = 777;
  const auto job = jobs_.submit(example_.view(), options);
  const auto answer = jobs_.result(job->job_id, {.wait = true});
  ASSERT_TRUE(answer.has_value());
  ASSERT_TRUE(comes_to(job->job_id, JobState::finished));
  const auto details = jobs_.get(job->job_id);
  ASSERT_TRUE(details.has_value());
  EXPECT_EQ(details->options.max_iterations, 777);
  EXPECT_EQ(details->job.status, answer->status);
  EXPECT_EQ(details->job.objective, answer->objective);
  ASSERT_FALSE(details->trace.rows.empty());
  EXPECT_EQ(details->trace.rows.back().iteration, answer->iterations);
}

TEST_F(JobsTest, WatchingAJobEndsWithIt) {
  const std::string blocker = submit_long();
  const auto job = jobs_.submit(examples::hopper({.steps = 6}).view());
  std::vector<JobState> states;
  bool trace_first = false;
  int newest = -1;
  const auto watched = jobs_.watch(job->job_id, [&](const JobEvent& event) {
    trace_first = states.empty() ? event.trace.has_value() : trace_first && !event.trace.has_value();
    if (states.empty()) {
      EXPECT_TRUE(jobs_.cancel(blocker).has_value());  // now it may begin
    }
    states.push_back(event.job.state);
    for (const Progress& row : event.rows) EXPECT_GT(row.iteration, std::exchange(newest, row.iteration));
  });
  ASSERT_TRUE(watched.has_value()) << watched.error().message();
  EXPECT_EQ(states.front(), JobState::queued);
  EXPECT_EQ(states.back(), JobState::finished);
  EXPECT_TRUE(trace_first);
  EXPECT_EQ(jobs_.get(job->job_id)->job.iterations, newest);
}

TEST_F(JobsTest, WatchingAllEndsWhenReportedTo) {
  std::stop_source source;
  const std::string id = submit_long();
  const auto watched = jobs_.watch("",
                                   [&](const JobEvent& event) {
                                     EXPECT_EQ(event.job.job_id, id);
                                     source.request_stop();
                                   },
                                   {.stop = source.get_token()});
  ASSERT_FALSE(watched.has_value());
  EXPECT_EQ(watched.error().code, ErrorCode::cancelled);
  EXPECT_EQ(jobs_.watch("nothing", [](const JobEvent&) {}).error().code, ErrorCode::not_found);
}

TEST_F(JobsTest, APlaceInTheQueueThatChangesIsReported) {
  const auto client = Client::connect(server_.address());
  const std::string blocker = submit_long();
  ASSERT_TRUE(comes_to(blocker, JobState::running));
  const std::string before = jobs_.submit(example_.view())->job_id;
  int accepted = -1, moved = -1;
  CallControls call;
  call.accepted = [&](const std::string&, int position, double) {
    accepted = position;
    EXPECT_TRUE(jobs_.cancel(before).has_value());
  };
  call.moved = [&](int position, double) {
    moved = position;
    EXPECT_TRUE(jobs_.cancel(blocker).has_value());
  };
  const auto answer = client->solve(example_.view(), {}, {}, call);
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(accepted, 1);
  EXPECT_EQ(moved, 0);
}

}  // namespace
}  // namespace marble::testing
