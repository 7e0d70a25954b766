// What levels of more and more samples promise, of BT6 under noise and of a pair that hides behind it.
#include "marble/retrospective.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "sampled_bt6.h"

namespace marble::testing {
namespace {

using nonlinear::Level;
using nonlinear::LevelTest;
using nonlinear::RetrospectiveAnswer;
using nonlinear::RetrospectiveSettings;
using nonlinear::SampledProblem;

Expected<RetrospectiveAnswer> solved_in_levels(const SampledProblem& sampled,
                                               const RetrospectiveSettings& settings = {}) {
  return nonlinear::solve_retrospective(sampled, nonlinear::open_ticks_in_process, settings);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

// The vectors published with Random123, of 0, of ones and of the digits of π.
TEST(CounterRandom, IsPhilox) {
  using Words = std::array<std::uint32_t, 4>;
  constexpr std::uint32_t kOnes = 0xffffffff;
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

// Of the first vector the words 0 and 1, then 2 and 3, higher word second.
TEST(CounterRandom, GivesEachNumberByItsPlaceAlone) {
  constexpr CounterRandom random(0);
  EXPECT_EQ(random.uniform(0, 0), static_cast<double>(0xe169c58d6627e8d5 >> 11) / 9007199254740992.0);
  EXPECT_EQ(random.uniform(0, 1), static_cast<double>(0x9b00dbd8bc57ac4c >> 11) / 9007199254740992.0);
  constexpr CounterRandom of_ones(0xffffffffffffffff);
  std::vector<double> all;
  for (std::uint64_t sample = 0; sample < 50; ++sample)
    for (std::uint32_t number = 0; number < 5; ++number)
      for (const CounterRandom& one : {random, of_ones}) all.push_back(one.uniform(sample << 20, number));
  EXPECT_TRUE(std::all_of(all.begin(), all.end(), [](double u) { return u >= 0.0 && u < 1.0; }));
  std::sort(all.begin(), all.end());
  EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end()) << "seed, sample and number all count";
}

TEST(CounterRandom, IsUniform) {
  constexpr int kBins = 16, kDraws = 160000;
  const CounterRandom random(7);
  std::vector<double> bins(kBins, 0.0);
  for (std::uint64_t i = 0; i < kDraws; ++i) ++bins[static_cast<std::size_t>(kBins * random.uniform(i))];
  double square = 0.0;  // chi squared of 15 degrees of freedom, 37.7 at a probability of 0.001
  constexpr double kExpected = 1.0 * kDraws / kBins;
  for (const double count : bins) square += std::pow(count - kExpected, 2) / kExpected;
  EXPECT_LT(square, 37.7);
}

TEST(Retrospective, LevelsAreNestedAndGrowByTheFactor) {
  const auto counts = [](const RetrospectiveSettings& settings) {
    SampledBt6 bt6(1);
    const auto answer = solved_in_levels(bt6.sampled(), settings);
    EXPECT_TRUE(answer.has_value()) << answer.error().message();
    std::vector<std::int64_t> reported;
    for (const Level& level : answer->levels) {
      EXPECT_EQ(level.level, static_cast<std::int32_t>(reported.size()));
      reported.push_back(level.samples);
    }
    EXPECT_EQ(bt6.asked, reported);
    return reported;
  };
  using Counts = std::vector<std::int64_t>;
  EXPECT_EQ(counts({.levels = 5}), (Counts{2, 4, 8, 16, 32}));
  EXPECT_EQ(counts({.first_samples = 3, .growth = 1.5, .levels = 6}), (Counts{3, 5, 7, 11, 16, 23}));
  EXPECT_EQ(counts({.first_samples = 1, .growth = 1.01, .levels = 4}), (Counts{1, 2, 3, 4}));
  EXPECT_EQ(counts({.first_samples = 10, .growth = 4, .levels = 9, .largest_samples = 100}),
            (Counts{10, 40, 100}));
  EXPECT_EQ(counts({.first_samples = 6, .levels = 3, .largest_samples = 6}), (Counts{6}));
}

TEST(Retrospective, TheSameSeedGivesTheSameBits) {
  const auto x_of = [](std::uint64_t seed) {
    SampledBt6 bt6(seed);
    const auto answer = solved_in_levels(bt6.sampled(), {.levels = 8});
    EXPECT_TRUE(answer.has_value());
    return answer->answer.x;
  };
  EXPECT_EQ(x_of(3), x_of(3));
  EXPECT_NE(x_of(3), x_of(4));
}

struct Course {
  std::vector<double> kkt, steps, lcqps, gradients;  // by level, median of the seeds, the last three so far
};

Course course_of_bt6(int seeds, RetrospectiveSettings settings) {
  std::map<std::size_t, Course> at;
  for (int seed = 0; seed < seeds; ++seed) {
    SampledBt6 bt6(static_cast<std::uint64_t>(seed));
    double steps = 0, lcqps = 0, gradients = 0;
    settings.level = [&](const Level& level) {
      Course& here = at[static_cast<std::size_t>(level.level)];
      const auto N = static_cast<double>(level.samples);
      steps += level.iterations, lcqps += level.ticks, gradients += N * level.linearisations;
      here.kkt.push_back(bt6.true_kkt(level.x) * std::sqrt(N));
      here.steps.push_back(steps), here.lcqps.push_back(lcqps), here.gradients.push_back(gradients / N);
    };
    EXPECT_TRUE(solved_in_levels(bt6.sampled(), settings).has_value());
  }
  Course made;
  for (const auto& [level, all] : at) {
    made.kkt.push_back(median(all.kkt)), made.steps.push_back(median(all.steps));
    made.lcqps.push_back(median(all.lcqps)), made.gradients.push_back(median(all.gradients));
  }
  return made;
}

// The median of 20 seeds alone wavers by a quarter.
TEST(Retrospective, TheErrorOfBt6FallsLikeTheRootOfItsSamples) {
  const Course course = course_of_bt6(200, {.levels = 13});
  for (std::size_t level = 3; level < course.kkt.size(); ++level) {
    EXPECT_GT(course.kkt[level], 1.5) << level;
    EXPECT_LT(course.kkt[level], 2.8) << level;
  }
  EXPECT_LT(course.lcqps.back(), 50);
  EXPECT_LT(course.gradients.back(), 6) << "the last levels cost more than all before";
}

TEST(Retrospective, LaterLevelsNeedFewSteps) {
  for (const LevelTest test : {LevelTest::merit, LevelTest::step}) {
    const Course course = course_of_bt6(20, {.levels = 18, .test = test});
    EXPECT_LE(course.steps.back() - course.steps[11], 2.0 * 6) << "at most two a level";
    EXPECT_LT(course.lcqps.back(), 60);
  }
}

TEST(Retrospective, CurvatureThatIsCarriedSavesSolves) {
  const Course carried = course_of_bt6(20, {.levels = 14});
  const Course anew = course_of_bt6(20, {.levels = 14, .carry_curvature = false});
  EXPECT_LT(carried.steps.back(), 0.8 * anew.steps.back());
  EXPECT_LT(carried.lcqps.back(), 0.8 * anew.lcqps.back());
}

TEST(Retrospective, AllLevelsAreAsExactAsTheyAreAsked) {
  SampledBt6 bt6(5, true);
  std::vector<Level> rough, exact;
  for (auto* levels : {&rough, &exact}) {
    SampledBt6 again(5, true);
    const auto answer = solved_in_levels(
        again.sampled(), {.levels = 9, .reduction = levels == &exact ? 1e-12 : std::optional<double>()});
    ASSERT_TRUE(answer.has_value());
    *levels = answer->levels;
  }
  for (std::size_t k = 0; k < rough.size(); ++k) {
    EXPECT_EQ(rough[k].status, Status::solved) << k;
    EXPECT_LT(exact[k].kkt_residual, 1e-5) << k;
    EXPECT_GE(exact[k].ticks, rough[k].ticks) << k;
  }
  EXPECT_GT(rough.back().kkt_residual, 100 * exact.back().kkt_residual);
}

// Residuals x − a over samples a: the average of their squares is least at the mean of a.
TEST(Retrospective, EveryKindOfCurvatureGoesOnFromLevelToLevel) {
  const CounterRandom random(13);
  for (const auto kind :
       {nonlinear::Curvature::exact, nonlinear::Curvature::gauss_newton, nonlinear::Curvature::bfgs}) {
    double mean = 0.0;
    const Formula formula{.name = "mean", .start = {4}, .parts = [&mean](const Jets& x) -> Parts {
                            return {.residuals = {exp(x[0]) - mean}};
                          }};
    SampledProblem sampled;
    sampled.problem = problem_of(formula, kind == nonlinear::Curvature::exact);
    sampled.use_samples = [&](std::int64_t N) {
      mean = 0.0;
      for (std::int64_t i = 0; i < N; ++i)
        mean += (1 + random.uniform(static_cast<std::uint64_t>(i))) / static_cast<double>(N);
    };
    RetrospectiveSettings settings{.loop = {.curvature = kind}, .levels = 12, .reduction = 1e-9};
    settings.level = [&](const Level& level) {
      EXPECT_NEAR(std::exp(level.x[0]), mean, 1e-3) << static_cast<int>(kind) << " at " << level.level;
    };
    const auto answer = solved_in_levels(sampled, settings);
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_LE(answer->levels.back().iterations, 4) << static_cast<int>(kind);
  }
}

// δ/√N: a wide one is met at once, at the x where the first level ended.
TEST(Retrospective, ATolerancePerRootOfSamplesEndsLevelsEarlier) {
  SampledBt6 wide(2), narrow(2);
  const auto early = solved_in_levels(wide.sampled(), {.levels = 8, .tolerance = 3.0});
  const auto late = solved_in_levels(narrow.sampled(), {.levels = 8});
  ASSERT_TRUE(early && late);
  EXPECT_LT(early->answer.ticks, late->answer.ticks);
  EXPECT_GT(early->answer.kkt_residual, late->answer.kkt_residual);
  EXPECT_TRUE(std::any_of(early->levels.begin(), early->levels.end(),
                          [](const Level& level) { return level.iterations == 0 && level.ticks == 1; }));
}

TEST(Retrospective, TheAnswerIsTheLastLevelsAndCountsAll) {
  SampledBt6 bt6(6);
  std::vector<double> last;
  RetrospectiveSettings settings{.levels = 6};
  settings.level = [&last](const Level& level) { last.assign(level.x.begin(), level.x.end()); };
  const auto answer = solved_in_levels(bt6.sampled(), settings);
  ASSERT_TRUE(answer.has_value());
  std::int32_t iterations = 0, ticks = 0, evaluations = 0;
  for (const Level& level : answer->levels) {
    iterations += level.iterations, ticks += level.ticks, evaluations += level.evaluations;
    EXPECT_GT(level.ticks, level.iterations) << "the one that reports the end";
    EXPECT_LE(level.linearisations, level.iterations + 1);
    EXPECT_TRUE(level.x.empty());
  }
  EXPECT_EQ(answer->answer.x, last);
  EXPECT_EQ(answer->answer.iterations, iterations);
  EXPECT_EQ(answer->answer.ticks, ticks);
  EXPECT_EQ(answer->answer.evaluations, evaluations);
  EXPECT_EQ(answer->answer.objective, answer->levels.back().objective);
  EXPECT_FALSE(answer->answer.b_stationary.has_value()) << "no zero step, no certificate";
}

// F = (x − a)² with a ~ U[0, 1] costs 1/12 at the best x; a fresh sample is none of the level's.
TEST(Retrospective, FreshSamplesEstimateTheCost) {
  const CounterRandom random(11);
  const auto a = [&random](std::int64_t i) { return random.uniform(static_cast<std::uint64_t>(i)); };
  std::int64_t N = 0, least_asked = 1 << 30;
  double mean = 0.0, gradient = 0.0;
  SampledProblem sampled;
  sampled.use_samples = [&](std::int64_t count) {
    N = count, mean = 0.0;
    for (std::int64_t i = 0; i < N; ++i) mean += a(i) / static_cast<double>(N);
  };
  sampled.problem.start = {3};
  sampled.problem.values = [&](std::span<const double> x) -> nonlinear::Values {
    return {.objective = (x[0] - mean) * (x[0] - mean)};
  };
  sampled.problem.derivatives = [&](std::span<const double> x) -> nonlinear::Derivatives {
    gradient = 2 * (x[0] - mean);
    return {.gradient = {&gradient, 1}};
  };
  sampled.sample_cost = [&](std::span<const double> x, std::int64_t i) {
    EXPECT_GE(i, N);
    least_asked = std::min(least_asked, i - N);
    return (x[0] - a(i)) * (x[0] - a(i));
  };
  const auto answer = solved_in_levels(sampled, {.levels = 10, .fresh_samples = 4000});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(least_asked, 0);
  const auto& estimate = answer->levels.back().estimate;
  ASSERT_TRUE(estimate.has_value());
  EXPECT_NEAR(estimate->mean, 1.0 / 12, 2 * estimate->half_width);
  // The variance of (x − a)² at x = ½ is 1/80 − 1/144 = 1/180.
  EXPECT_NEAR(estimate->half_width, 1.96 * std::sqrt(1.0 / 180 / 4000), 0.1 * estimate->half_width);

  sampled.sample_cost = [](std::span<const double>, std::int64_t i) { return i == 5 ? NAN : 0.0; };
  const auto fault = solved_in_levels(sampled, {});
  ASSERT_FALSE(fault.has_value());
  EXPECT_EQ(fault.error().field, "sample_cost");
  EXPECT_EQ(fault.error().index, 5);
}

// A foot over a floor whose height, 1 on the average, is known by noisy measures alone, as is what a row
// allows its force. It presses with 1 where it stands.
TEST(Retrospective, PairsAndRowsMayBeAveragesToo) {
  const CounterRandom random(12);
  double floor = 0.0, limit = 0.0;
  Formula formula{.name = "floor", .start = {2, 0.5}, .parts = [&](const Jets& x) {
                    Parts made;
                    made.objective = square(x[0]) + square(x[1] - 1);
                    made.G = {x[0] - floor}, made.H = {x[1]};
                    made.inequalities = {limit - sin(x[1])};
                    return made;
                  }};
  SampledProblem sampled;
  sampled.problem = problem_of(formula, false);
  sampled.use_samples = [&](std::int64_t N) {
    floor = limit = 0.0;
    for (std::int64_t i = 0; i < N; ++i) {
      floor += 2 * random.uniform(static_cast<std::uint64_t>(i), 0) / static_cast<double>(N);
      limit += 1.8 * random.uniform(static_cast<std::uint64_t>(i), 1) / static_cast<double>(N);
    }
  };
  const auto answer = solved_in_levels(sampled, {.first_samples = 4, .levels = 10});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->answer.status, Status::solved) << answer->answer.detail;
  EXPECT_NEAR(answer->answer.x[0], 1.0, 0.05);
  EXPECT_NEAR(answer->answer.x[1], 1.0, 0.05);
  EXPECT_LT(answer->answer.violation, 1e-3);
}

TEST(Retrospective, LimitsEndAllLevels) {
  SampledBt6 bt6(7);
  const auto timed = solved_in_levels(bt6.sampled(), {.loop = {.time_limit_s = 1e-9}});
  ASSERT_TRUE(timed.has_value());
  EXPECT_EQ(timed->answer.status, Status::time_limit);
  EXPECT_EQ(timed->levels.size(), 1u);
  std::stop_source stop;
  RetrospectiveSettings settings{.loop = {.stop = stop.get_token()}};
  settings.level = [&stop](const Level& level) {
    if (level.level == 1) stop.request_stop();
  };
  SampledBt6 again(7);
  const auto stopped = solved_in_levels(again.sampled(), settings);
  ASSERT_TRUE(stopped.has_value());
  EXPECT_EQ(stopped->answer.status, Status::cancelled);
  EXPECT_EQ(stopped->levels.size(), 3u);
  EXPECT_EQ(stopped->answer.x.size(), 5u);
}

// One step a level: each says so, and the next goes on from there.
TEST(Retrospective, ALevelThatIsNotSolvedIsGoneOnFrom) {
  SampledBt6 bt6(8);
  const auto answer = solved_in_levels(bt6.sampled(), {.loop = {.iteration_limit = 1}, .levels = 12});
  ASSERT_TRUE(answer.has_value());
  ASSERT_EQ(answer->levels.size(), 12u);
  EXPECT_EQ(answer->levels.front().status, Status::iteration_limit);
  EXPECT_LT(answer->levels.back().violation, 0.1 * answer->levels.front().violation);
}

TEST(Retrospective, WhatIsWrongIsRefusedByName) {
  const std::pair<const char*, RetrospectiveSettings> all[] = {
      {"settings.first_samples", {.first_samples = 0}},
      {"settings.growth", {.growth = 1.0}},
      {"settings.growth", {.growth = std::nan("")}},
      {"settings.levels", {.levels = 0}},
      {"settings.largest_samples", {.first_samples = 9, .largest_samples = 8}},
      {"settings.reduction", {.reduction = 0.0}},
      {"settings.reduction", {.reduction = 1.0}},
      {"settings.tolerance", {.tolerance = -1.0}},
      {"settings.fresh_samples", {.fresh_samples = 1}},
      {"settings.radius", {.loop = {.radius = 0.0}}},
  };
  for (const auto& [field, settings] : all) {
    SampledBt6 bt6(9);
    const auto answer = solved_in_levels(bt6.sampled(), settings);
    ASSERT_FALSE(answer.has_value()) << field;
    EXPECT_EQ(answer.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(answer.error().field, field);
    EXPECT_TRUE(bt6.asked.empty()) << "before any sample is drawn";
  }
  SampledBt6 bt6(9);
  bt6.sampled().use_samples = {};
  EXPECT_EQ(solved_in_levels(bt6.sampled()).error().field, "use_samples");
}

}  // namespace
}  // namespace marble::testing
