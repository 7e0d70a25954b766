// The queue alone, on simulated time: what is promised about order, fairness and bounds.
#include "jobs/job_queue.h"

#include <gtest/gtest.h>

#include <deque>
#include <random>

namespace marble::server {
namespace {

using Queue = JobQueue<int>;
using Time = Queue::Time;

constexpr QueueLimits kWide{.workers = 1, .jobs = 1000, .bytes = 1'000'000, .starvation_limit = 32};
constexpr Quota kFree{};

Time at(double time_s) {
  return Time() + std::chrono::duration_cast<Time::duration>(std::chrono::duration<double>(time_s));
}

std::shared_ptr<int> add(Queue& queue, int number, const Ticket& ticket, const Quota& quota = kFree) {
  auto item = std::make_shared<int>(number);
  EXPECT_EQ(queue.push(item, ticket, quota), QueueRefusal::none) << number;
  return item;
}

std::vector<int> run_all(Queue& queue) {
  std::vector<int> order;
  while (const auto item = queue.pop()) {
    order.push_back(*item);
    queue.done(item.get());
  }
  return order;
}

TEST(JobQueue, GivesOneClientsJobsInTheOrderTheyCame) {
  Queue queue(kWide);
  for (int i = 0; i < 4; ++i) add(queue, i, {.client = "a"});
  EXPECT_EQ(run_all(queue), (std::vector{0, 1, 2, 3}));
  EXPECT_EQ(queue.clients(), 0U) << "nothing is kept of clients that have nothing in it";
}

TEST(JobQueue, GivesTheEarliestDeadlineOfAClientFirst) {
  Queue queue(kWide);
  add(queue, 0, {.client = "a"});
  add(queue, 1, {.client = "a", .deadline = at(9)});
  add(queue, 2, {.client = "a", .deadline = at(3)});
  add(queue, 3, {.client = "a", .deadline = at(9)});
  EXPECT_EQ(run_all(queue), (std::vector{2, 1, 3, 0}));
}

TEST(JobQueue, AJobWithoutADeadlineIsDueInTimeToo) {
  Queue queue({.workers = 1, .jobs = 100, .bytes = 100, .patience = std::chrono::seconds(10)});
  add(queue, 0, {.client = "a", .arrival = at(0)});
  for (int i = 1; i <= 3; ++i) add(queue, i, {.client = "a", .deadline = at(7.0 * i), .arrival = at(9)});
  EXPECT_EQ(run_all(queue), (std::vector{1, 0, 2, 3})) << "due at 10: later than 7, earlier than 14";
}

TEST(JobQueue, ADeadlineBuysNothingAgainstOtherClients) {
  Queue queue(kWide);
  add(queue, 0, {.client = "a"});
  add(queue, 1, {.client = "b", .deadline = at(1)});
  EXPECT_EQ(run_all(queue), (std::vector{0, 1}));
}

TEST(JobQueue, ClientsTakeTurns) {
  Queue queue(kWide);
  for (int i = 0; i < 3; ++i) add(queue, i, {.client = "flood"});
  add(queue, 10, {.client = "b"});
  add(queue, 20, {.client = "c"});
  add(queue, 21, {.client = "c"});
  EXPECT_EQ(run_all(queue), (std::vector{0, 10, 20, 1, 21, 2}));
}

TEST(JobQueue, AHigherPriorityGoesFirst) {
  Queue queue(kWide);
  add(queue, 2, {.client = "a", .priority = Priority::batch});
  add(queue, 1, {.client = "a", .priority = Priority::interactive});
  add(queue, 0, {.client = "b", .priority = Priority::realtime});
  EXPECT_EQ(run_all(queue), (std::vector{0, 1, 2}));
}

TEST(JobQueue, APriorityThatIsStarvationLimitTooOftenInARowGoesInBetween) {
  Queue queue({.workers = 1, .jobs = 1000, .bytes = 1000, .starvation_limit = 3});
  add(queue, 100, {.client = "b", .priority = Priority::batch});
  add(queue, 50, {.client = "i", .priority = Priority::interactive});
  for (int i = 0; i < 9; ++i) add(queue, i, {.client = "r", .priority = Priority::realtime});
  EXPECT_EQ(run_all(queue), (std::vector{0, 1, 2, 50, 100, 3, 4, 5, 6, 7, 8}));
}

TEST(JobQueue, APriorityThatIsStarvationLimitForTooLongGoesInBetween) {
  using std::chrono::seconds;
  Queue queue(
      {.workers = 1, .jobs = 1000, .bytes = 1000, .starvation_limit = 1000, .starvation_time = seconds(3)});
  add(queue, 50, {.client = "i", .priority = Priority::interactive});
  add(queue, 51, {.client = "i", .priority = Priority::interactive});
  for (int i = 0; i < 9; ++i) add(queue, i, {.client = "r", .priority = Priority::realtime});
  std::vector<int> order;
  for (Queue::Time now(seconds(1000)); const auto item = queue.pop(now); now += seconds(2)) {
    order.push_back(*item);
    queue.done(item.get());
  }
  EXPECT_EQ(order, (std::vector{0, 1, 50, 2, 3, 51, 4, 5, 6, 7, 8}));
}

TEST(JobQueue, OneWhoIsServedNowAndThenDoesNotGetAhead) {
  // A tick that comes while a batch runs is next: the batch was served just before, so it was not passed
  // over.
  Queue queue({.workers = 1, .jobs = 1000, .bytes = 1000, .starvation_limit = 2});
  for (int i = 0; i < 20; ++i) add(queue, 100 + i, {.client = "flood", .priority = Priority::batch});
  for (int tick = 0; tick < 10; ++tick) {
    const auto batch = queue.pop();
    ASSERT_GE(*batch, 100);
    add(queue, tick, {.client = "loop", .priority = Priority::realtime, .reserved = true});
    queue.done(batch.get());
    const auto next = queue.pop();
    EXPECT_EQ(*next, tick);
    queue.done(next.get());
  }
}

TEST(JobQueue, AClientAtItsQuotaOfRunningJobsIsLeftOut) {
  Queue queue({.workers = 3, .jobs = 10, .bytes = 1000});
  const Quota one{.running = 1};
  add(queue, 0, {.client = "a"}, one);
  add(queue, 1, {.client = "a"}, one);
  add(queue, 2, {.client = "b"});
  const auto first = queue.pop();
  EXPECT_EQ(*first, 0);
  EXPECT_EQ(*queue.pop(), 2);
  EXPECT_FALSE(queue.ready());
  EXPECT_EQ(queue.pop(), nullptr);
  queue.done(first.get());
  EXPECT_TRUE(queue.ready());
  EXPECT_EQ(*queue.pop(), 1);
}

TEST(JobQueue, RefusesBeyondEachBoundAndSaysWhich) {
  Queue queue({.workers = 1, .jobs = 2, .bytes = 100});
  const Quota quota{.queued = 2, .bytes = 50};
  const auto push = [&](const Ticket& ticket) { return queue.push(std::make_shared<int>(0), ticket, quota); };
  EXPECT_EQ(push({.client = "a", .bytes = 51}), QueueRefusal::client_bytes);
  EXPECT_EQ(push({.client = "a", .bytes = 101}), QueueRefusal::bytes);
  add(queue, 1, {.client = "a", .bytes = 50}, quota);
  EXPECT_EQ(push({.client = "a", .bytes = 1}), QueueRefusal::client_bytes);
  add(queue, 2, {.client = "a"}, quota);
  EXPECT_EQ(push({.client = "a"}), QueueRefusal::client_jobs);
  add(queue, 3, {.client = "b"}, quota);
  EXPECT_FALSE(queue.has_room(Priority::realtime));
  EXPECT_EQ(push({.client = "c"}), QueueRefusal::jobs) << "2 that wait, and one for the free worker";
  EXPECT_EQ(push({.client = "c", .reserved = true}), QueueRefusal::none) << "a session has its place";
}

TEST(JobQueue, WhatWaitsInSessionsCountsAndTakesAQuarterOfAClientAndHalfOfAll) {
  Queue queue({.workers = 1, .jobs = 10, .bytes = 100});
  EXPECT_TRUE(queue.hold("a", 25, kFree));
  EXPECT_FALSE(queue.hold("a", 1, kFree));
  EXPECT_FALSE(queue.hold("b", 11, {.bytes = 10}));
  EXPECT_TRUE(queue.hold("b", 20, kFree));
  EXPECT_FALSE(queue.hold("c", 6, kFree));
  EXPECT_EQ(queue.bytes(), 45);
  const auto job = add(queue, 0, {.client = "a", .bytes = 55});
  EXPECT_EQ(queue.push(std::make_shared<int>(1), {.client = "c", .bytes = 1}, kFree), QueueRefusal::bytes);
  EXPECT_EQ(queue.pop(), job);
  queue.done(job.get());
  EXPECT_EQ(queue.clients(), 2U);
  queue.release("a", 25);
  queue.release("b", 20);
  EXPECT_EQ(queue.bytes(), 0);
  EXPECT_EQ(queue.clients(), 0U);
}

TEST(JobQueue, AFloodLeavesOnePlaceInSixteenToRealtimeJobs) {
  Queue queue({.workers = 1, .jobs = 32, .bytes = 100});
  const auto push = [&](const char* client, Priority priority) {
    return queue.push(std::make_shared<int>(0), {.client = client, .priority = priority}, kFree);
  };
  for (int i = 0; i < 31; ++i)
    ASSERT_EQ(push("flood", Priority::batch), QueueRefusal::none) << "30 that wait, one for the free worker";
  EXPECT_EQ(push("flood", Priority::batch), QueueRefusal::jobs);
  EXPECT_EQ(push("other", Priority::interactive), QueueRefusal::jobs);
  EXPECT_TRUE(queue.has_room(Priority::realtime));
  for (int i = 0; i < 2; ++i) EXPECT_EQ(push("planner", Priority::realtime), QueueRefusal::none);
  EXPECT_EQ(push("planner", Priority::realtime), QueueRefusal::jobs);
}

TEST(JobQueue, NoWaitingMeansThatOnlyFreeWorkersCount) {
  Queue queue({.workers = 1, .jobs = 0, .bytes = 100});
  add(queue, 0, {.client = "a"});
  const auto running = queue.pop();
  EXPECT_EQ(queue.push(std::make_shared<int>(1), {.client = "a"}, kFree), QueueRefusal::jobs);
  queue.done(running.get());
  add(queue, 2, {.client = "a"});
}

TEST(JobQueue, RemovesOnlyWhatWaits) {
  Queue queue(kWide);
  const auto first = add(queue, 0, {.client = "a"});
  const auto second = add(queue, 1, {.client = "a"});
  EXPECT_TRUE(queue.remove(second.get()));
  EXPECT_FALSE(queue.remove(second.get()));
  const auto running = queue.pop();
  EXPECT_EQ(running, first);
  EXPECT_FALSE(queue.remove(first.get()));
  queue.done(first.get());
  EXPECT_EQ(queue.clients(), 0U);
}

TEST(JobQueue, TakesOutWhatCannotMeetItsDeadlineAnyMore) {
  Queue queue(kWide);
  add(queue, 0, {.client = "a", .deadline = at(10)});
  add(queue, 1, {.client = "a", .deadline = at(10), .least_run = std::chrono::seconds(4)});
  add(queue, 2, {.client = "b"});
  EXPECT_TRUE(queue.expire(at(5)).empty());
  const auto hopeless = queue.expire(at(6));
  ASSERT_EQ(hopeless.size(), 1U);
  EXPECT_EQ(*hopeless[0], 1);
  EXPECT_EQ(queue.expire(at(10)).size(), 1U);
  EXPECT_EQ(run_all(queue), (std::vector{2}));
}

TEST(JobQueue, ReportsWhatIsAheadAsItWillBeTaken) {
  Queue queue(kWide);
  std::vector<std::shared_ptr<int>> items;
  int number = 0;
  for (const char* client : {"a", "a", "b", "c", "a", "b"})
    items.push_back(add(queue, number++, {.client = client}));
  items.push_back(add(queue, number++, {.client = "z", .priority = Priority::realtime}));
  items.push_back(add(queue, number++, {.client = "z", .priority = Priority::batch}));
  std::vector<std::size_t> reported;
  queue.update_places();
  for (const auto& item : items) {
    const auto ahead = queue.ahead_of(item.get());
    reported.push_back(ahead[0] + ahead[1] + ahead[2]);
  }
  const std::vector<int> order = run_all(queue);
  for (std::size_t place = 0; place < order.size(); ++place)
    EXPECT_EQ(reported[static_cast<std::size_t>(order[place])], place) << "job " << order[place];
}

TEST(JobQueue, ReportsTheWorkAheadOfJobsOfAnySize) {
  Queue queue(kWide);
  const auto job = [](const char* client, double deadline_s, double run_s) {
    return Ticket{.client = client, .deadline = at(deadline_s), .expected_run_s = run_s};
  };
  const auto large = add(queue, 0, job("a", 9, 4.0));
  const auto other = add(queue, 1, job("a", 8, 2.0));
  const auto small = add(queue, 2, job("a", 1, 0.25));
  EXPECT_EQ(queue.work_ahead_s(small.get()), 0.0) << "none of the large ones, which are due later";
  const auto middle = add(queue, 3, job("a", 5, 0.5));
  EXPECT_EQ(queue.work_ahead_s(middle.get()), 0.25);
  const auto last = add(queue, 4, job("a", 10, 1.0));
  EXPECT_EQ(queue.work_ahead_s(last.get()), 6.75);
  const auto guest = add(queue, 5, job("b", 1, 8.0));
  EXPECT_DOUBLE_EQ(queue.work_ahead_s(guest.get()), 1.55) << "one of the first client's, at their mean";
  const auto urgent = add(queue, 6, {.client = "c", .priority = Priority::realtime, .expected_run_s = 3.0});
  EXPECT_DOUBLE_EQ(queue.work_ahead_s(guest.get()), 4.55);
  ASSERT_EQ(queue.pop(), urgent);
  EXPECT_EQ(queue.work_ahead_s(urgent.get()), 0.0) << "it runs";
  queue.update_places();
  EXPECT_EQ(queue.work_ahead_s(guest.get()), 0.25);
  EXPECT_EQ(queue.work_ahead_s(middle.get()), 8.25);
  EXPECT_EQ(queue.work_ahead_s(last.get()), 14.75);
  ASSERT_TRUE(queue.remove(large.get()));
  const auto later = add(queue, 7, job("a", 11, 1.0));
  EXPECT_EQ(queue.work_ahead_s(later.get()), 3.75 + 8.0);
}

// An estimate for who has just come: exact of the last in line while all others have as many, never too low.
TEST(JobQueue, ReportsOneThatHasJustComeNoLessThanWhatIsAhead) {
  std::mt19937 random(3);
  const auto pick = [&random](int most) { return std::uniform_int_distribution<int>(0, most)(random); };
  for (int trial = 0; trial < 50; ++trial) {
    Queue queue(kWide);
    const std::vector<std::string> names = {"a", "b", "c", "d"};
    for (int number = 0; number < 40; ++number) {
      const Ticket ticket{.client = names[static_cast<std::size_t>(pick(3))], .deadline = at(pick(50))};
      const auto item = add(queue, number, ticket);
      const std::size_t first = queue.ahead_of(item.get())[1];
      queue.update_places();
      const std::size_t exact = queue.ahead_of(item.get())[1];
      ASSERT_GE(first, exact);
      ASSERT_LT(first, exact + names.size());
      if (pick(4) == 0) queue.done(queue.pop().get());
    }
  }
}

// Random arrivals, ends and cancels on simulated time, checked against what is promised after every step.
class JobQueueProperty : public ::testing::TestWithParam<int> {};

TEST_P(JobQueueProperty, KeepsItsPromisesWhateverComes) {
  std::mt19937 random(static_cast<unsigned>(GetParam()));
  const auto pick = [&random](int most) { return std::uniform_int_distribution<int>(0, most)(random); };
  const QueueLimits limits{
      .workers = 1 + pick(2), .jobs = pick(12), .bytes = 40 + pick(60), .starvation_limit = 1 + pick(4)};
  const auto due = [&limits](const Ticket& t) { return std::min(t.deadline, t.arrival + limits.patience); };
  Queue queue(limits);
  const std::vector<std::string> names = {"a", "b", "c", "d"};
  std::vector<Quota> quotas;
  for (std::size_t i = 0; i < names.size(); ++i)
    quotas.push_back({.running = 1 + pick(2), .queued = 1 + pick(6), .bytes = 20 + pick(60)});
  struct Waiting {
    std::shared_ptr<int> item;
    Ticket ticket;
    std::size_t client;
    int waited = 0;  // jobs taken meanwhile while it might have been
  };
  std::vector<Waiting> waiting;
  std::deque<Waiting> running;
  std::vector<int> running_of(names.size(), 0);
  int number = 0;
  for (int step = 0; step < 600; ++step) {
    const int what = pick(9);
    if (what < 4) {
      const auto client = static_cast<std::size_t>(pick(3));
      Ticket ticket{.client = names[client],
                    .priority = static_cast<Priority>(pick(2)),
                    .deadline = pick(1) == 0 ? Time::max() : at(step + 1 + pick(100)),
                    .arrival = at(step),
                    .bytes = pick(12)};
      const auto item = std::make_shared<int>(number++);
      const auto why = queue.push(item, ticket, quotas[client]);
      if (why == QueueRefusal::none) waiting.push_back({item, ticket, client});
      std::int64_t bytes = 0;
      for (const Waiting& w : waiting) bytes += w.ticket.bytes;
      for (const Waiting& r : running) bytes += r.ticket.bytes;
      const bool full =
          waiting.size() + running.size() >= static_cast<std::size_t>(limits.jobs + limits.workers);
      if (why == QueueRefusal::jobs) {
        EXPECT_TRUE(full);
      }
      ASSERT_EQ(queue.bytes(), bytes);
      ASSERT_LE(bytes, limits.bytes);
      ASSERT_LE(waiting.size() + running.size(), static_cast<std::size_t>(limits.jobs + limits.workers));
    } else if (what < 7 && running.size() < static_cast<std::size_t>(limits.workers)) {
      const auto able = [&](const Waiting& w) { return running_of[w.client] < quotas[w.client].running; };
      const auto item = queue.pop();
      const auto taken =
          std::find_if(waiting.begin(), waiting.end(), [&](const Waiting& w) { return w.item == item; });
      if (item == nullptr) {  // work conserving
        EXPECT_TRUE(std::none_of(waiting.begin(), waiting.end(), able)) << "step " << step;
        continue;
      }
      ASSERT_NE(taken, waiting.end());
      EXPECT_TRUE(able(*taken));
      for (const Waiting& other : waiting) {  // order within a client and priority
        if (other.client != taken->client || other.ticket.priority != taken->ticket.priority) continue;
        EXPECT_LE(std::pair(due(taken->ticket), *taken->item), std::pair(due(other.ticket), *other.item));
      }
      // No starvation: an able client's best job is taken before everybody else had starvation_limit + 1
      // turns of each client at each priority.
      for (Waiting& other : waiting) {
        const bool first = std::none_of(waiting.begin(), waiting.end(), [&](const Waiting& w) {
          return w.client == other.client && w.ticket.priority == other.ticket.priority &&
                 std::pair(due(w.ticket), *w.item) < std::pair(due(other.ticket), *other.item);
        });
        other.waited = first && able(other) ? other.waited + 1 : 0;
        EXPECT_LE(other.waited, static_cast<int>(names.size()) * 3 * (limits.starvation_limit + 1));
      }
      running.push_back(*taken);
      ++running_of[taken->client];
      waiting.erase(taken);
    } else if (what < 9 && !running.empty()) {
      const Waiting ended = running.front();
      running.pop_front();
      --running_of[ended.client];
      queue.done(ended.item.get());
    } else if (!waiting.empty()) {
      const auto victim = waiting.begin() + pick(static_cast<int>(waiting.size()) - 1);
      EXPECT_TRUE(queue.remove(victim->item.get()));
      waiting.erase(victim);
    }
    for (const auto& late : queue.expire(at(step))) {
      const auto found =
          std::find_if(waiting.begin(), waiting.end(), [&](const Waiting& w) { return w.item == late; });
      ASSERT_NE(found, waiting.end());
      EXPECT_LE(found->ticket.deadline, at(step));
      waiting.erase(found);
    }
    for (const Waiting& w : waiting) EXPECT_GT(w.ticket.deadline, at(step));
    ASSERT_EQ(queue.waiting(), waiting.size());
    ASSERT_EQ(queue.running(), static_cast<int>(running.size()));
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, JobQueueProperty, ::testing::Range(0, 40));

}  // namespace
}  // namespace marble::server
