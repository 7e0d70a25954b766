// Updates with deadlines: what is answered, by when, and what the next one begins with.
#include "marble/solver.h"
#include "session_service_test.h"
#include "support/independent_check.h"

namespace marble::testing {
namespace {

TEST_F(Session, AnUpdateTooLateIsReportedAndItsNumbersStay) {
  start({"--workers", "1"});
  const auto call = set_up(setup_of(example_request()));
  Stream blocker(solver(), blocking_request());
  ASSERT_TRUE(blocker.read_until(Event::kStarted));
  v1::SessionRequest late = update(1);
  late.mutable_update()->set_deadline_s(0.05);
  late.mutable_update()->mutable_problem()->add_equality_offset(-3.0);
  const auto refused = ask(*call, late);  // while the worker is still busy
  ASSERT_TRUE(refused && refused->has_error());
  EXPECT_EQ(refused->error().status().code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_EQ(counters().running(), 1);
  blocker.cancel();
  EXPECT_NEAR(ask(*call, update(2))->answer().solution().z(0), 3.0, 1e-9);
}

TEST_F(Session, ADeadlineEndsARunningUpdateWithItsBestPoint) {
  start();
  const auto call = set_up(setup_of(long_request()));
  v1::SessionRequest request = update(1);
  request.mutable_update()->set_deadline_s(0.3);
  const auto answer = ask(*call, request);
  ASSERT_TRUE(answer && answer->has_answer());
  EXPECT_EQ(answer->answer().solution().status(), v1::STATUS_TIME_LIMIT);
  EXPECT_EQ(answer->answer().solution().origin(), v1::POINT_ORIGIN_SOLVE);
  EXPECT_GT(answer->answer().solution().iterations(), 0);
  EXPECT_TRUE(eventually_idle());
}

// A planner whose first step is cold, and slower than every deadline after it.
TEST_F(Session, AfterAColdStepAShorterDeadlineIsTried) {
  start({"--workers", "1"});
  const auto call = set_up(setup_of(examples::hopper({.steps = 20})));
  const auto cold = ask(*call, update(1));
  ASSERT_TRUE(cold && cold->has_answer());
  const double cold_s = cold->answer().solution().times().solve_s();
  int solved = 0;
  for (int step = 2; step <= 40; ++step) {
    v1::SessionRequest request = update(step);
    request.mutable_update()->set_deadline_s(0.4 * cold_s);
    const auto answer = ask(*call, request);
    ASSERT_TRUE(answer);
    solved += answer->has_answer() && answer->answer().solution().status() == v1::STATUS_SOLVED ? 1 : 0;
  }
  EXPECT_GE(solved, 1) << "a warm step takes a fraction of that";
}

// Each has time for a few steps only; together they come to the end. A deadline that was measured while the
// machine was busy may suffice for the whole: a shorter one does not.
TEST_F(Session, UpdatesThatRunOutOfTimeGoOnUntilOneIsSolved) {
  start({"--workers", "1", "--session-misses", "1000000"});
  const OwnedProblem p = examples::gates();
  int misses = 0;
  for (double deadline_s = 0.3 * solve_in_process(p.view())->times.solve_s; misses == 0; deadline_s *= 0.5) {
    const auto call = set_up(setup_of(p));
    std::optional<Solution> solved;
    for (int step = 1; step <= 1000 && !solved; ++step) {
      v1::SessionRequest request = update(step);
      request.mutable_update()->set_deadline_s(deadline_s);
      const auto answer = ask(*call, request);
      ASSERT_TRUE(answer);
      if (!answer->has_answer()) continue;  // a busy machine had no worker for it
      Solution solution = solution_of(answer->answer().solution());
      misses += solution.status == Status::time_limit ? 1 : 0;
      if (is_solved(solution.status)) solved = std::move(solution);
    }
    ASSERT_TRUE(solved);
    EXPECT_LE(judge(p.view(), *solved).infeasibility(), 1e-6);
  }
}

TEST_F(Session, AnUpdateWithoutTimeIsAnsweredWithTheSolutionBeforeItWhereThatIsFeasible) {
  start();
  const OwnedProblem p = examples::hopper({.steps = 20});
  const auto call = set_up(setup_of(p));
  const auto first = ask(*call, update(1));
  ASSERT_TRUE(first && first->has_answer());
  v1::SessionRequest request = update(2);
  request.mutable_update()->mutable_options()->set_time_limit_s(1e-9);
  std::vector<double> g = p.g;
  for (double& value : g) value += 1e-3;
  to_message(ProblemUpdate{.g = g}, request.mutable_update()->mutable_problem());
  const auto second = ask(*call, request);
  ASSERT_TRUE(second && second->has_answer());
  EXPECT_EQ(second->answer().solution().status(), v1::STATUS_TIME_LIMIT);
  EXPECT_EQ(second->answer().solution().origin(), v1::POINT_ORIGIN_PREVIOUS);
  EXPECT_EQ(solution_of(second->answer().solution()).z, solution_of(first->answer().solution()).z);
}

TEST_F(Session, AfterTooManyMissesInARowItBeginsAnewAndSaysSo) {
  start({"--session-misses", "2"});
  const auto call = set_up(setup_of(examples::rocket()));
  const auto cold = ask(*call, update(1));
  ASSERT_TRUE(cold && cold->has_answer());
  for (int step = 2; step <= 3; ++step) {
    v1::SessionRequest request = update(step);
    request.mutable_update()->mutable_options()->set_time_limit_s(1e-9);
    const auto missed = ask(*call, request);
    ASSERT_TRUE(missed && missed->has_answer());
    EXPECT_EQ(missed->answer().solution().status(), v1::STATUS_TIME_LIMIT);
    EXPECT_EQ(missed->answer().restarts(), step - 2);
  }
  v1::SessionRequest request = update(4);
  request.mutable_update()->mutable_options()->set_time_limit_s(1e3);
  const auto anew = ask(*call, request);
  ASSERT_TRUE(anew && anew->has_answer());
  EXPECT_EQ(anew->answer().solution().factorizations(), cold->answer().solution().factorizations());
}

TEST_F(Session, AnUpdateOfAnotherEpochIsRefused) {
  start();
  v1::SessionRequest setup = setup_of(example_request());
  setup.mutable_setup()->set_epoch(3);
  const auto call = open();
  ASSERT_TRUE(call->write(setup));
  const auto ready = call->next();
  ASSERT_TRUE(ready && ready->has_ready());
  EXPECT_EQ(ready->ready().epoch(), 3);
  v1::SessionRequest stale = update(1);
  stale.mutable_update()->set_epoch(2);
  const auto refused = ask(*call, stale);
  ASSERT_TRUE(refused && refused->has_error());
  EXPECT_EQ(refused->error().epoch(), 3);
  EXPECT_EQ(refused->error().status().code(), grpc::StatusCode::FAILED_PRECONDITION);
  v1::SessionRequest fresh = update(1);
  fresh.mutable_update()->set_epoch(3);
  const auto answer = ask(*call, fresh);
  ASSERT_TRUE(answer && answer->has_answer());
  EXPECT_EQ(answer->answer().epoch(), 3);
}

TEST_F(Session, ANegativeEpochIsRefused) {
  start();
  v1::SessionRequest setup = setup_of(example_request());
  setup.mutable_setup()->set_epoch(-1);
  const auto call = open();
  ASSERT_TRUE(call->write(setup));
  EXPECT_FALSE(call->next().has_value());
  const grpc::Status status = call->finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(status).field(), "setup.epoch");
}

}  // namespace
}  // namespace marble::testing
