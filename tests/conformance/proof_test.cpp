// Proofs by a server (option global_search): the same as here, and long ones watched and ended.
#include <gtest/gtest.h>

#include <cmath>

#include "marble/client.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "problems.h"
#include "support/same_solution.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

class ProofTest : public ::testing::Test {
 protected:
  static Options global(int node_limit = 1000000) {
    Options options;
    options.global_search = true;
    options.node_limit = node_limit;
    return options;
  }
  [[nodiscard]] int running() const { return client_.info()->running; }

  // No tree of it comes to an end in the time of a test.
  const OwnedProblem endless_ = examples::qpec({}, 0);
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "2"}};
  Client client_ = Client::connect(server_.address()).value();
};

TEST_F(ProofTest, IsTheSameHereAndThereWhetherAnotherWorkerHelpsOrNot) {
  const Solution here = solve_in_process(endless_.view(), global(200)).value();
  EXPECT_GT(here.nodes, 100);
  const auto helped = client_.solve(endless_.view(), global(200));
  ASSERT_TRUE(helped.has_value()) << helped.error().message();
  expect_same_bits(*helped, here);
  const auto other = client_.jobs().submit(endless_.view(), global());
  ASSERT_TRUE(eventually([&] { return running() == 1; }));
  const auto alone = client_.solve(endless_.view(), global(200));
  ASSERT_TRUE(alone.has_value()) << alone.error().message();
  expect_same_bits(*alone, here);
  EXPECT_TRUE(client_.jobs().cancel(other->job_id).has_value());
}

TEST_F(ProofTest, AnswersOfSmallProblemsAreProvedAndInfeasibilityToo) {
  for (const auto& [problem, optimum] : small_problems()) {
    const auto answer = client_.solve(problem.view(), global());
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    if (!answer->proved) continue;  // not convex where its pairs are left open
    EXPECT_LE(answer->bound, optimum + 1e-6 * std::max(1.0, std::abs(optimum))) << problem.name;
    EXPECT_NEAR(answer->objective, optimum, 1e-5 * std::max(1.0, std::abs(optimum))) << problem.name;
  }
}

struct Closing final : ProgressSink {
  std::vector<Progress> rows;
  void report(const Progress& row) override {
    if (row.nodes > 0) rows.push_back(without_vectors(row));
  }
};

TEST_F(ProofTest, ProgressClosesInFromBothSides) {
  Closing closing;
  const auto answer = client_.solve(endless_.view(), global(200), {.progress = &closing});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  ASSERT_GT(closing.rows.size(), 1U);
  for (std::size_t i = 1; i < closing.rows.size(); ++i) {
    const Progress &row = closing.rows[i], &before = closing.rows[i - 1];
    EXPECT_GE(row.bound, before.bound);
    EXPECT_LE(row.incumbent, before.incumbent);
    EXPECT_GE(row.nodes, before.nodes);
    EXPECT_GE(row.elapsed_s, before.elapsed_s);
    EXPECT_LE(row.bound, row.incumbent + 1e-9 * std::abs(row.incumbent));
  }
  EXPECT_LE(closing.rows.back().nodes, answer->nodes);
  EXPECT_LE(answer->objective, closing.rows.back().incumbent);
}

TEST_F(ProofTest, ALongOneIsSubmittedWatchedAndCancelledWithItsIncumbentAndItsBound) {
  const Jobs jobs = client_.jobs();
  const auto job = jobs.submit(endless_.view(), global());
  ASSERT_TRUE(job.has_value()) << job.error().message();
  JobInfo seen;
  bool cancelled = false;
  const auto watched = jobs.watch(job->job_id, [&](const JobEvent& event) {
    if (event.job.state != JobState::running || event.job.nodes < 20 || cancelled) return;
    seen = event.job;
    cancelled = jobs.cancel(job->job_id).has_value();
  });
  ASSERT_TRUE(watched.has_value()) << watched.error().message();
  ASSERT_TRUE(cancelled);
  const auto answer = jobs.result(job->job_id);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->status, Status::cancelled);
  EXPECT_FALSE(answer->proved);
  EXPECT_GE(answer->nodes, seen.nodes);
  EXPECT_GE(answer->bound, seen.bound);
  EXPECT_LE(answer->objective, seen.incumbent);
  EXPECT_LE(answer->bound, answer->objective);
  EXPECT_LE(answer->violations.complementarity, 1e-6) << "the incumbent, not what a node made of it";
  const JobDetails after = *jobs.get(job->job_id);
  EXPECT_EQ(after.job.incumbent, answer->objective);
  EXPECT_EQ(after.job.bound, answer->bound);
  EXPECT_EQ(after.job.gap, answer->gap);
  EXPECT_EQ(after.job.nodes, answer->nodes);
  EXPECT_EQ(after.job.open_nodes, answer->open_nodes);
  EXPECT_GT(after.trace.rows.back().nodes, 0);
}

TEST_F(ProofTest, ALimitIsAnAnswer) {
  const auto few = client_.solve(endless_.view(), global(5));
  ASSERT_TRUE(few.has_value()) << few.error().message();
  EXPECT_EQ(few->status, Status::iteration_limit) << few->detail;
  EXPECT_GT(few->nodes, 0);
  EXPECT_LE(few->nodes, 5);
  EXPECT_GT(few->open_nodes, 0);
  EXPECT_LE(few->bound, few->objective);
  EXPECT_FALSE(few->proved);
  Options short_of_time = global();
  short_of_time.time_limit_s = 1.0;
  const auto late = client_.solve(endless_.view(), short_of_time);
  ASSERT_TRUE(late.has_value()) << late.error().message();
  EXPECT_EQ(late->status, Status::time_limit) << late->detail;
  EXPECT_LE(late->bound, late->objective);
}

TEST_F(ProofTest, ADeadlineEndsItOnAllWorkers) {
  const auto answer =
      client_.solve(endless_.view(), global(), {}, {.deadline = std::chrono::duration<double>(0.5)});
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::deadline_exceeded);
  EXPECT_TRUE(eventually([&] { return running() == 0; }));
  EXPECT_TRUE(client_.solve(public_example().problem.view()).has_value());
}

TEST_F(ProofTest, OneWhoseCallerIsGoneEnds) {
  {
    const auto pending = client_.solve_async(endless_.view(), global());
    ASSERT_TRUE(eventually([&] { return running() == 1; }));
  }
  EXPECT_TRUE(eventually([&] { return running() == 0; }));
}

TEST_F(ProofTest, ATreeStaysWithinTheMemoryOfASolve) {
  const auto local = client_.solve(endless_.view());
  const std::int64_t bytes = client_.jobs().get(local->job_id)->job.memory_bytes;
  ASSERT_GT(bytes, 0);
  const ServerProcess small(MARBLE_SERVER_BINARY, {"--solve-bytes", std::to_string(bytes + 1000)});
  const auto answer = Client::connect(small.address())->solve(endless_.view(), global());
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved);
  EXPECT_EQ(answer->objective, local->objective);
  EXPECT_FALSE(answer->proved);
  EXPECT_EQ(answer->nodes, 0) << "not even a few nodes fit";
  EXPECT_NE(answer->detail.find("memory"), std::string::npos) << answer->detail;
}

TEST_F(ProofTest, ASessionThatKeepsItsTreeProvesEveryTickAsOneThatDoesNot) {
  constexpr int kStages = 5;
  examples::HopperParameters parameters{.steps = kStages};
  const OwnedProblem first = examples::hopper(parameters);
  auto kept = client_.open_session(first.view(), global());
  auto anew = client_.open_session(first.view(), global());
  ASSERT_TRUE(kept.has_value()) << kept.error().message();
  ASSERT_TRUE(anew.has_value()) << anew.error().message();
  const UpdateControls next{.shift = Shift::by_stage(first.view(), kStages).value()};
  int warm = 0;
  for (int tick = 0; tick < 20; ++tick) {
    const OwnedProblem p = examples::hopper(parameters);
    const ProblemUpdate numbers{.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r};
    const auto answer = kept->solve(numbers, tick == 0 ? UpdateControls() : next);
    const auto cold = anew->solve(numbers, {.initial_z = p.initial_z, .cold = true});
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    ASSERT_TRUE(cold.has_value()) << cold.error().message();
    const double scale = std::max(1.0, std::abs(cold->objective));
    EXPECT_TRUE(answer->proved) << answer->detail;
    EXPECT_TRUE(cold->proved) << cold->detail;
    EXPECT_NEAR(answer->objective, cold->objective, 2e-6 * scale);
    EXPECT_LE(answer->bound, cold->objective + 1e-7 * scale) << "a bound holds for every point";
    EXPECT_EQ(cold->reused_nodes, 0);
    warm += answer->reused_nodes > 0;
    parameters = examples::advance(parameters, answer->z);
  }
  EXPECT_GE(warm, 10);
}

}  // namespace
}  // namespace marble::testing
