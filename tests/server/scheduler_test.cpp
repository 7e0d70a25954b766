// The scheduler with real workers and real solves, and observers in place of RPCs.
#include "jobs/scheduler.h"

#include <gtest/gtest.h>

#include <functional>
#include <future>
#include <random>
#include <set>
#include <thread>

#include "marble/convert.h"
#include "marble/examples.h"
#include "problems.h"
#include "support/child_process.h"

namespace marble::server {
namespace {

using testing::eventually;

class Waiter final : public JobObserver {
 public:
  void started(double) override { started_.set_value(); }
  void finished(Outcome outcome) override {
    outcome_.set_value(std::move(outcome));
  }  // throws if reported twice
  void wait_started() { started_.get_future().wait(); }
  Outcome wait() { return outcome_.get_future().get(); }
  /// False if it was never reported.
  [[nodiscard]] bool waited() {
    return outcome_.get_future().wait_for(std::chrono::seconds(120)) == std::future_status::ready;
  }

 private:
  std::promise<void> started_;
  std::promise<Outcome> outcome_;
};

struct Request {
  std::shared_ptr<Waiter> waiter = std::make_shared<Waiter>();
  std::shared_ptr<Job> job;
  std::weak_ptr<const v1::SolveRequest> message;
};

Request make(const v1::SolveRequest& message) {
  Request request;
  const auto owned = std::make_shared<const v1::SolveRequest>(message);
  const Problem problem = Problem::create(view_of(owned->problem())).value();
  const Options options = options_of(owned->options()).value();
  request.job = std::make_shared<Job>();
  request.job->record = std::make_shared<JobRecord>(JobDescription{.id = "id"}, options, 16);
  request.job->ticket = {.client = "client", .bytes = 100};
  request.job->work = [owned, problem, options](const SolveControls& controls) {
    return Solver::create(problem, options)->solve(controls);
  };
  request.message = owned;
  request.job->observer = request.waiter;
  return request;
}

Solution made_up_solution() {
  Solution solution;
  solution.status = Status::solved;
  return solution;
}

class SchedulerTest : public ::testing::Test {
 protected:
  Log log_{"text", "off", 1 << 20};
  Metrics metrics_{true, 1};
  JobBoard board_{{}};
};

TEST_F(SchedulerTest, AnswersAndLetsGoOfRequestAndObserver) {
  Scheduler scheduler({.workers = 1, .jobs = 1, .bytes = 1000}, board_, log_, metrics_);
  const Request request = make(testing::example_request());
  const std::weak_ptr<const v1::SolveRequest> message = request.message;
  ASSERT_TRUE(scheduler.admit(request.job).has_value());
  const Outcome outcome = request.waiter->wait();
  ASSERT_TRUE(outcome.solution.has_value());
  EXPECT_EQ(outcome.solution->status, Status::solved);
  EXPECT_TRUE(message.expired());
  EXPECT_TRUE(eventually([&] { return request.waiter.use_count() == 1; }));
}

TEST_F(SchedulerTest, RefusesBeyondJobsAndBytes) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 250}, board_, log_, metrics_);
  const Request running = make(testing::long_request()), waiting = make(testing::long_request());
  const Request third = make(testing::example_request());
  ASSERT_TRUE(scheduler.admit(running.job).has_value());
  running.waiter->wait_started();
  ASSERT_EQ(scheduler.admit(waiting.job)->position, 0);
  const auto refused = scheduler.admit(third.job);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(refused.error().field, "queue_bytes");
  scheduler.cancel(running.job);
  scheduler.cancel(waiting.job);
}

TEST_F(SchedulerTest, AWaitingJobIsCancelledAtOnceAndNeverStarts) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const Request running = make(testing::long_request()), waiting = make(testing::long_request());
  ASSERT_TRUE(scheduler.admit(running.job).has_value());
  running.waiter->wait_started();
  ASSERT_TRUE(scheduler.admit(waiting.job).has_value());
  scheduler.cancel(waiting.job);
  const Outcome outcome = waiting.waiter->wait();
  ASSERT_FALSE(outcome.solution.has_value());
  EXPECT_EQ(outcome.solution.error().code, ErrorCode::cancelled);
  EXPECT_EQ(scheduler.counters().running, 1);
  scheduler.cancel(running.job);
  EXPECT_EQ(running.waiter->wait().solution->status, Status::cancelled);
}

TEST_F(SchedulerTest, AJobThatIsLateNeverStarts) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const Request late = make(testing::long_request());
  late.job->ticket.deadline = Clock::now();
  ASSERT_TRUE(scheduler.admit(late.job).has_value());
  const Outcome outcome = late.waiter->wait();
  ASSERT_FALSE(outcome.solution.has_value());
  EXPECT_EQ(outcome.solution.error().code, ErrorCode::deadline_exceeded);
}

// Of jobs that take 50 ms: one that would have to wait as long as it has time is refused, but not on a free
// worker.
TEST_F(SchedulerTest, WhatCannotEndInTimeIsRefusedAtOnce) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const auto slow = [] {
    Request request = make(testing::example_request());
    request.job->work = [](const SolveControls& /*controls*/) -> Expected<Solution> {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      return made_up_solution();
    };
    return request;
  };
  const Request known = slow(), alone = slow(), hasty = slow(), patient = slow(), free = slow();
  ASSERT_TRUE(scheduler.admit(known.job).has_value());
  ASSERT_TRUE(known.waiter->wait().solution.has_value());
  alone.job->ticket.deadline = Clock::now() + std::chrono::milliseconds(20);
  ASSERT_TRUE(scheduler.admit(alone.job).has_value());
  static_cast<void>(alone.waiter->wait());
  const Request running = make(testing::long_request());
  ASSERT_TRUE(scheduler.admit(running.job).has_value());
  running.waiter->wait_started();
  hasty.job->ticket.deadline = Clock::now() + std::chrono::milliseconds(20);
  const auto could = scheduler.may_enter(hasty.job);
  ASSERT_FALSE(could.has_value());
  EXPECT_EQ(could.error().field, "deadline");
  const auto refused = scheduler.admit(hasty.job);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(refused.error().field, "deadline");
  patient.job->ticket.deadline = Clock::now() + std::chrono::hours(1);
  EXPECT_TRUE(scheduler.may_enter(patient.job).has_value());
  EXPECT_EQ(scheduler.counters().queued, 0) << "it was only a question";
  ASSERT_TRUE(scheduler.admit(patient.job).has_value());
  ASSERT_TRUE(scheduler.admit(free.job).has_value());
  scheduler.cancel(running.job);
  EXPECT_TRUE(patient.waiter->wait().solution.has_value());
  EXPECT_TRUE(free.waiter->wait().solution.has_value());
}

// One worker, and a job on it that would take for ever.
TEST_F(SchedulerTest, AnUpdateOfASessionRunsOnTopOfAJobOfLowerPriority) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const Request batch = make(testing::long_request());
  batch.job->ticket.priority = Priority::batch;
  ASSERT_TRUE(scheduler.admit(batch.job).has_value());
  batch.waiter->wait_started();
  for (int step = 0; step < 3; ++step) {
    const Request update = make(testing::example_request());
    update.job->ticket.priority = Priority::realtime;
    update.job->ticket.may_preempt = true;
    ASSERT_TRUE(scheduler.admit(update.job).has_value());
    const Outcome outcome = update.waiter->wait();
    ASSERT_TRUE(outcome.solution.has_value());
    EXPECT_EQ(outcome.solution->status, Status::solved);
  }
  EXPECT_TRUE(eventually([&] { return scheduler.counters().running == 1; })) << "the job goes on";
  scheduler.cancel(batch.job);
  EXPECT_EQ(batch.waiter->wait().solution->status, Status::cancelled);
}

// One worker, whose job is preempted by a job that is preempted, too.
TEST_F(SchedulerTest, AnUpdateThatPreemptsAJobMakesWayForAMoreUrgentOne) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const Request batch = make(testing::long_request());
  batch.job->ticket.priority = Priority::batch;
  ASSERT_TRUE(scheduler.admit(batch.job).has_value());
  batch.waiter->wait_started();
  std::atomic<bool> go_on = true;
  const Request slow = make(testing::example_request()), urgent = make(testing::example_request());
  slow.job->ticket.may_preempt = urgent.job->ticket.may_preempt = true;
  slow.job->work = [&](const SolveControls& controls) -> Expected<Solution> {
    while (go_on && !controls.stop.stop_requested()) controls.pause->look();
    return made_up_solution();
  };
  ASSERT_TRUE(scheduler.admit(slow.job).has_value());
  slow.waiter->wait_started();
  urgent.job->ticket.priority = Priority::realtime;
  ASSERT_TRUE(scheduler.admit(urgent.job).has_value());
  EXPECT_TRUE(urgent.waiter->wait().solution.has_value());
  EXPECT_TRUE(eventually([&] { return scheduler.counters().running == 1; })) << "the slow one goes on";
  go_on = false;
  EXPECT_TRUE(slow.waiter->wait().solution.has_value());
  scheduler.cancel(batch.job);
  EXPECT_EQ(batch.waiter->wait().solution->status, Status::cancelled);
}

TEST_F(SchedulerTest, AJobOfTheSamePriorityOrWithoutMemoryOfItsOwnWaits) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const Request running = make(testing::long_request());
  running.job->ticket.priority = Priority::realtime;
  ASSERT_TRUE(scheduler.admit(running.job).has_value());
  running.waiter->wait_started();
  const Request equal = make(testing::example_request());
  equal.job->ticket.priority = Priority::realtime;
  equal.job->ticket.may_preempt = true;
  ASSERT_TRUE(scheduler.admit(equal.job).has_value());
  EXPECT_EQ(scheduler.counters().queued, 1);
  scheduler.cancel(running.job);
  EXPECT_TRUE(equal.waiter->wait().solution.has_value());
  EXPECT_EQ(running.waiter->wait().solution->status, Status::cancelled);
}

// What it steps aside for takes longer than its time limit.
TEST_F(SchedulerTest, APausedJobGoesOnWithTheSameBitsAndItsTimeLimitStandsStill) {
  const OwnedProblem p = examples::hopper({.steps = 40});
  const Problem problem = Problem::create(p.view()).value();
  Options options;
  const Solution alone = Solver::create(problem, options)->solve().value();
  options.time_limit_s = 1.0 + 10.0 * alone.times.solve_s;
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  Request paused = make(testing::example_request());
  paused.job->ticket.priority = Priority::batch;
  paused.job->work = [&](const SolveControls& controls) {
    return Solver::create(problem, options)->solve(controls);
  };
  const double longer_s = 1.5 * options.time_limit_s;
  Request update = make(testing::example_request());
  update.job->ticket.priority = Priority::realtime;
  update.job->ticket.may_preempt = true;
  update.job->work = [&](const SolveControls& /*controls*/) -> Expected<Solution> {
    std::this_thread::sleep_for(std::chrono::duration<double>(longer_s));
    return made_up_solution();
  };
  ASSERT_TRUE(scheduler.admit(paused.job).has_value());
  paused.waiter->wait_started();
  ASSERT_TRUE(scheduler.admit(update.job).has_value());
  const Outcome outcome = paused.waiter->wait();
  ASSERT_TRUE(outcome.solution.has_value());
  EXPECT_EQ(outcome.solution->status, Status::solved);
  EXPECT_EQ(outcome.solution->z, alone.z);
  EXPECT_EQ(outcome.solution->factorizations, alone.factorizations);
  EXPECT_LT(outcome.solution->times.solve_s, longer_s);
  EXPECT_TRUE(update.waiter->wait().solution.has_value());
}

TEST_F(SchedulerTest, CancellingAFinishedJobDoesNothing) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const Request request = make(testing::example_request());
  ASSERT_TRUE(scheduler.admit(request.job).has_value());
  EXPECT_TRUE(request.waiter->wait().solution.has_value());
  scheduler.cancel(request.job);
  EXPECT_EQ(scheduler.counters().answered, 1);
  EXPECT_EQ(scheduler.counters().cancelled, 0);
}

TEST_F(SchedulerTest, AfterCloseNothingIsAdmitted) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  scheduler.close();
  const auto refused = scheduler.admit(make(testing::example_request()).job);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::unavailable);
}

TEST_F(SchedulerTest, DrainAnswersEveryJobExactlyOnce) {
  std::vector<Request> requests;
  Scheduler scheduler({.workers = 2, .jobs = 50, .bytes = 100'000}, board_, log_, metrics_);
  for (int i = 0; i < 20; ++i) {
    requests.push_back(make(i < 2 ? testing::long_request() : testing::example_request()));
    ASSERT_TRUE(scheduler.admit(requests.back().job).has_value());
  }
  scheduler.drain(std::chrono::duration<double>(0.0));
  for (const Request& request : requests) {
    const Outcome outcome = request.waiter->wait();
    if (!outcome.solution) {
      EXPECT_EQ(outcome.solution.error().code, ErrorCode::unavailable);
    }
  }
  const Counters counters = scheduler.counters();
  EXPECT_EQ(counters.accepted, 20);
  EXPECT_EQ(counters.answered + counters.cancelled, 20);
  EXPECT_EQ(counters.queued + counters.running, 0);
}

TEST_F(SchedulerTest, ManyThreadsAdmitAndCancelAndEveryJobEndsOnce) {
  Scheduler scheduler({.workers = 2, .jobs = 8, .bytes = 100'000}, board_, log_, metrics_);
  std::vector<std::thread> threads;
  std::atomic<int> admitted = 0, refused = 0;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 50; ++i) {
        const Request request = make(i % 5 == 0 ? testing::long_request(50) : testing::example_request());
        if (!(i % 2 == 0 ? scheduler.admit(request.job) : scheduler.admit_here(request.job))) {
          ++refused;
          continue;
        }
        ++admitted;
        if ((i + t) % 3 == 0) scheduler.cancel(request.job);
        (void)request.waiter->wait();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  scheduler.drain(std::chrono::duration<double>(0.0));
  const Counters counters = scheduler.counters();
  EXPECT_EQ(admitted + refused, 200);
  EXPECT_EQ(counters.accepted, admitted);
  EXPECT_EQ(counters.answered + counters.cancelled, admitted);
}

// Whether a job that does nothing runs on the thread that admits it.
bool runs_here(Scheduler& scheduler) {
  std::thread::id ran_on;
  const Request request = make(testing::example_request());
  request.job->work = [&ran_on](const SolveControls&) -> Expected<Solution> {
    ran_on = std::this_thread::get_id();
    return made_up_solution();
  };
  EXPECT_TRUE(scheduler.admit_here(request.job).has_value());
  EXPECT_TRUE(request.waiter->wait().solution.has_value());
  return ran_on == std::this_thread::get_id();
}

TEST_F(SchedulerTest, AJobLikeShortOnesRunsOnItsOwnThreadWhileAWorkerIsIdle) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  EXPECT_FALSE(runs_here(scheduler)) << "nobody knows yet how long it takes";
  EXPECT_TRUE(eventually([&] { return runs_here(scheduler); })) << "known, and the worker is idle again";
  const Request running = make(testing::long_request()), waiting = make(testing::example_request());
  ASSERT_TRUE(scheduler.admit(running.job).has_value());
  running.waiter->wait_started();
  ASSERT_TRUE(scheduler.admit_here(waiting.job).has_value());
  EXPECT_EQ(scheduler.counters().queued, 1) << "no worker is idle";
  scheduler.cancel(running.job);
  EXPECT_TRUE(waiting.waiter->wait().solution.has_value());
}

TEST_F(SchedulerTest, WhatTakesTooLongThereIsBegunAnewByAWorkerToTheSameBits) {
  Scheduler scheduler({.workers = 1, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  const v1::SolveRequest message = testing::long_request(5000);
  const Request alone = make(message);
  const Solution expected = alone.job->work({}).value();
  const auto is_begun_twice = [&] {
    EXPECT_TRUE(eventually([&] { return runs_here(scheduler); }));
    int begun = 0;
    const Request request = make(message);
    request.job->work = [&begun, work = request.job->work](const SolveControls& controls) {
      ++begun;
      return work(controls);
    };
    EXPECT_TRUE(scheduler.admit_here(request.job).has_value());
    const Outcome outcome = request.waiter->wait();
    EXPECT_EQ(outcome.solution.value().z, expected.z);
    EXPECT_EQ(outcome.solution.value().iterations, expected.iterations);
    return begun == 2;
  };
  EXPECT_TRUE(eventually(is_begun_twice)) << "unless something else made the short ones slow";
  EXPECT_TRUE(eventually([&] { return scheduler.counters().running == 0; }));
  EXPECT_EQ(scheduler.counters().answered, scheduler.counters().accepted);
}

// Nodes of a tree are such pieces: a job that comes waits for the one at hand, not for the round.
TEST_F(SchedulerTest, AJobWaitsForOnePieceOfAnothersRoundNotForTheRound) {
  Scheduler scheduler({.workers = 2, .jobs = 5, .bytes = 1000}, board_, log_, metrics_);
  std::promise<void> owner_may, helper_may, helper_began;
  const std::shared_future<void> owner_goes(owner_may.get_future()), helper_goes(helper_may.get_future());
  std::atomic<int> done = 0, helped = 0, done_before = -1;
  const Request round = make(testing::example_request()), realtime = make(testing::example_request());
  round.job->work = [&](const SolveControls& controls) -> Expected<Solution> {
    const std::function<void()> piece = [&, owner = std::this_thread::get_id()] {
      const bool first = std::this_thread::get_id() != owner && helped++ == 0;
      if (first) helper_began.set_value();
      if (first) helper_goes.wait();
      if (std::this_thread::get_id() == owner) owner_goes.wait();
      ++done;
    };
    controls.runner->run(std::vector(8, piece));
    return Solution{};
  };
  realtime.job->ticket.priority = Priority::realtime;
  realtime.job->work = [&](const SolveControls&) -> Expected<Solution> {
    done_before = done.load();
    return Solution{};
  };
  ASSERT_TRUE(scheduler.admit(round.job).has_value());
  helper_began.get_future().wait();
  ASSERT_TRUE(scheduler.admit(realtime.job).has_value());
  helper_may.set_value();
  EXPECT_TRUE(realtime.waiter->wait().solution.has_value());
  EXPECT_EQ(done_before, 1) << "the one that its worker had begun";
  owner_may.set_value();
  EXPECT_TRUE(round.waiter->wait().solution.has_value());
  EXPECT_EQ(done, 8);
}

// Each client waits for its own job before it sends another, so that no later one wakes a worker in its
// stead: a job that nobody was woken for would wait for ever.
TEST_F(SchedulerTest, NoWakeUpIsLostHoweverJobsComeShareWorkAndGo) {
  Scheduler scheduler({.workers = 4, .jobs = 100, .bytes = 1000}, board_, log_, metrics_);
  constexpr int kClients = 6, kJobs = 5000;
  std::atomic<int> answered = 0, pieces = 0, shared = 0;
  const std::vector<std::function<void()>> tasks(3, [&pieces] { ++pieces; });
  std::vector<std::thread> clients;
  for (int c = 0; c < kClients; ++c) {
    clients.emplace_back([&, c, random = std::minstd_rand(static_cast<unsigned>(c + 1))]() mutable {
      for (int i = 0; i < kJobs; ++i) {
        const bool crowded = random() % 2 == 0;  // one at a time of all these
        const bool given_up = random() % 4 == 0;
        const auto shares = std::span(tasks).first(random() % 2 * (random() % 4));
        const auto waiter = std::make_shared<Waiter>();
        const auto job = std::make_shared<Job>();
        const std::string id = std::to_string(c) + "-" + std::to_string(i);
        job->record = std::make_shared<JobRecord>(JobDescription{.id = id}, Options(), 0);
        job->ticket = {.client = crowded ? "crowd" : std::to_string(c), .bytes = 1};
        job->ticket.priority = static_cast<Priority>(random() % kPriorities);
        if (crowded) job->quota.running = 1;
        job->work = [&shared, shares](const SolveControls& controls) -> Expected<Solution> {
          shared += static_cast<int>(shares.size());
          controls.runner->run(shares);
          return Solution{};
        };
        job->observer = waiter;
        const bool here = random() % 2 == 0;
        if (!(here ? scheduler.admit_here(job) : scheduler.admit(job))) continue;  // never: there is room
        if (given_up) scheduler.cancel(job);
        if (!waiter->waited()) return;
        ++answered;
      }
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(answered, kClients * kJobs);
  EXPECT_EQ(pieces, shared) << "none, one or several: each once";
  EXPECT_TRUE(eventually([&] { return scheduler.counters().running == 0; }));
}

}  // namespace
}  // namespace marble::server
