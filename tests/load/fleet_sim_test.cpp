// The simulation against what queueing theory knows, and against itself.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "simulation.h"

namespace marble::fleet_sim {
namespace {

std::vector<double> exponential_times(double mean_s) {
  std::mt19937_64 random(3);
  std::exponential_distribution<double> distribution(1.0 / mean_s);
  std::vector<double> times(200'000);
  for (double& time : times) time = distribution(random);
  return times;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// So many planners that each asks once in the whole run: their ticks come as if at random.
Plan crowd(int workers, double busy) {
  Plan plan;
  plan.service_s = exponential_times(0.01);
  plan.workers = workers;
  plan.rate_hz = 0.001;
  plan.planners = static_cast<int>(busy * workers / 0.01 / plan.rate_hz);
  plan.deadline_s = 0.0;
  plan.network_s = 0.0;
  plan.warm_s = 0.0;
  plan.run_s = 1000.0;
  return plan;
}

TEST(FleetSim, OneWorkersQueueWaitsAsTheoryHasIt) {
  const Outcome outcome = simulate(crowd(1, 0.7));
  const double expected_s = 0.7 / (1.0 - 0.7) * 0.01;  // M/M/1
  EXPECT_NEAR(mean(outcome.wait_s), expected_s, 0.1 * expected_s);
  EXPECT_NEAR(outcome.busy, 0.7, 0.02);
}

TEST(FleetSim, FourWorkersShareOneQueueAsTheoryHasIt) {
  const Outcome outcome = simulate(crowd(4, 0.8));
  // Erlang's formula for M/M/4 at 3.2 of 4: a tick waits with probability 0.5964, then 0.01 s / (4 - 3.2) on
  // average.
  const double expected_s = 0.5964 * 0.01 / 0.8;
  EXPECT_NEAR(mean(outcome.wait_s), expected_s, 0.1 * expected_s);
}

TEST(FleetSim, AClosedLoopKeepsAsManyWorkersBusyAsThereArePlanners) {
  Plan plan = crowd(4, 0.5);
  plan.planners = 3;
  plan.rate_hz = 0.0;
  plan.run_s = 10.0;
  const Outcome outcome = simulate(plan);
  EXPECT_NEAR(outcome.busy, 0.75, 1e-3);
  EXPECT_EQ(quantile(outcome.wait_s, 1.0), 0.0);
  plan.planners = 40;
  EXPECT_NEAR(simulate(plan).busy, 1.0, 1e-3);
}

TEST(FleetSim, EveryTickIsAnsweredLateOrSuperseded) {
  Plan plan;
  plan.service_s = {0.01};
  plan.planners = 100;  // twice what four workers can do
  plan.rate_hz = 8.0;
  plan.run_s = 10.0;
  for (const bool sessions : {false, true}) {
    plan.sessions = sessions;
    const Outcome outcome = simulate(plan);
    const std::int64_t reported = outcome.answered + outcome.late + outcome.superseded;
    EXPECT_LE(reported, outcome.ticks);
    EXPECT_GE(reported, outcome.ticks - 2L * plan.planners) << "but those under way at the end";
    EXPECT_GT(outcome.missed(), 0.4);
    EXPECT_GT(outcome.busy, 0.99);
  }
}

TEST(FleetSim, WhoKnowsMoreWaitsLess) {
  Plan plan;
  plan.service_s = exponential_times(0.01);
  plan.servers = 20;
  plan.planners = 3200;  // of 8000 ticks a second that 80 workers can do, 80 %
  plan.rate_hz = 2.0;
  plan.deadline_s = 0.0;
  const auto wait_s = [&](Balance balance) {
    plan.balance = balance;
    return mean(simulate(plan).wait_s);
  };
  const double least = wait_s(Balance::least), two = wait_s(Balance::two),
               turns = wait_s(Balance::round_robin), random = wait_s(Balance::random);
  EXPECT_LT(least, two);
  EXPECT_LT(two, turns);
  EXPECT_LT(turns, random);
}

TEST(FleetSim, ASlowServerGetsLessWorkFromWhoCountsCallsAndAsMuchFromWhoTakesTurns) {
  Plan plan;
  plan.service_s = {0.01};
  plan.servers = 3;
  plan.planners = 300;
  plan.rate_hz = 2.0;
  plan.slow_factor = 1.8;
  plan.deadline_s = 0.0;
  const auto share = [&](Balance balance) {
    plan.balance = balance;
    const Outcome outcome = simulate(plan);
    return static_cast<double>(outcome.served.front()) / static_cast<double>(outcome.served.back());
  };
  EXPECT_LT(share(Balance::least), 0.8);
  EXPECT_NEAR(share(Balance::round_robin), 1.0, 0.05);
}

TEST(FleetSim, TheAutoscalerFollowsARampWithinItsDelay) {
  Plan plan;
  plan.service_s = {0.01};
  plan.planners = 1000;
  plan.rate_hz = 4.0;  // 40 workers' work
  plan.servers = 4;
  plan.ramp_from = 0.1;
  plan.ramp_s = 60.0;
  plan.run_s = 120.0;
  plan.autoscaler = {5.0, 10.0, 5.0, 2.4};
  const Outcome scaled = simulate(plan);
  EXPECT_NEAR(scaled.servers_at_end, 40.0 / 2.4, 2.0);
  EXPECT_LT(scaled.missed(), 0.05);
  plan.autoscaler.poll_s = 0.0;
  const Outcome left_alone = simulate(plan);
  EXPECT_EQ(left_alone.servers_at_end, 4);
  EXPECT_GT(left_alone.missed(), 0.3);
}

TEST(FleetSim, TheSameSeedGivesTheSameRun) {
  const Plan plan = crowd(2, 0.6);
  EXPECT_EQ(simulate(plan).wait_s, simulate(plan).wait_s);
}

}  // namespace
}  // namespace marble::fleet_sim
