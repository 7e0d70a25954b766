#include "arrivals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace marble::load {
namespace {

constexpr int kArrivals = 100'000;
constexpr double kRate = 250.0;

std::vector<double> gaps_s(ArrivalProcess process, std::uint64_t seed) {
  Arrivals arrivals(process, kRate, seed);
  std::vector<double> gaps;
  double before = 0.0;
  for (int i = 0; i < kArrivals; ++i) {
    const double at = std::chrono::duration<double>(arrivals.next()).count();
    gaps.push_back(at - before);
    before = at;
  }
  return gaps;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

TEST(Arrivals, FixedOnesComeAtEvenTimesAndDoNotDrift) {
  Arrivals arrivals(ArrivalProcess::fixed, 3.0, 1);
  for (std::int64_t i = 1; i <= 3'000'000; ++i) {
    const auto at = arrivals.next();
    if (i % 3 == 0) {
      ASSERT_EQ(at, std::chrono::seconds(i / 3));
    }
  }
}

TEST(Arrivals, PoissonOnesHaveTheRate) {
  // The mean of N exponential gaps has the relative deviation 1/sqrt(N): five of them.
  EXPECT_NEAR(mean(gaps_s(ArrivalProcess::poisson, 1)) * kRate, 1.0, 5.0 / std::sqrt(kArrivals));
}

TEST(Arrivals, PoissonGapsAreExponential) {
  auto gaps = gaps_s(ArrivalProcess::poisson, 2);
  std::sort(gaps.begin(), gaps.end());
  double distance = 0.0;  // of Kolmogorov and Smirnov
  for (std::size_t i = 0; i < gaps.size(); ++i) {
    const double part = 1.0 - std::exp(-kRate * gaps[i]);
    distance = std::max({distance, std::abs(part - static_cast<double>(i) / kArrivals),
                         std::abs(part - static_cast<double>(i + 1) / kArrivals)});
  }
  EXPECT_LT(distance, 1.95 / std::sqrt(kArrivals));  // exceeded by one true sample in a thousand
}

TEST(Arrivals, PoissonGapsDoNotRememberEachOther) {
  const auto gaps = gaps_s(ArrivalProcess::poisson, 3);
  const double average = mean(gaps);
  double together = 0.0, alone = 0.0;
  for (std::size_t i = 1; i < gaps.size(); ++i) {
    together += (gaps[i] - average) * (gaps[i - 1] - average);
    alone += (gaps[i] - average) * (gaps[i] - average);
  }
  EXPECT_LT(std::abs(together / alone), 5.0 / std::sqrt(kArrivals));
}

TEST(Arrivals, ASeedGivesTheSameAgainAndAnotherOneOthers) {
  EXPECT_EQ(gaps_s(ArrivalProcess::poisson, 4), gaps_s(ArrivalProcess::poisson, 4));
  EXPECT_NE(gaps_s(ArrivalProcess::poisson, 4), gaps_s(ArrivalProcess::poisson, 5));
}

}  // namespace
}  // namespace marble::load
