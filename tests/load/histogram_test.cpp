#include "histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <thread>
#include <vector>

#include "arrivals.h"

namespace marble::load {
namespace {

// The same definition by sorting: the smallest value that this part of all does not exceed.
std::int64_t exact_quantile(std::vector<std::int64_t> values, double part) {
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(values.size())));
  return values[std::max<std::size_t>(rank, 1) - 1];
}

void expect_three_digits(std::int64_t found, std::int64_t exact) {
  EXPECT_GE(found, exact);
  EXPECT_LE(static_cast<double>(found), 1.001 * static_cast<double>(exact));
}

// Values over many powers of ten, as latencies are.
std::vector<std::int64_t> random_values(std::mt19937_64& engine, std::size_t count) {
  std::vector<std::int64_t> values;
  const double most = 1.0 + 11.0 * uniform(engine);
  for (std::size_t i = 0; i < count; ++i)
    values.push_back(static_cast<std::int64_t>(std::pow(10.0, most * uniform(engine))));
  return values;
}

TEST(Histogram, QuantilesAreWithinAThousandthAboveThoseOfTheSortedValues) {
  std::mt19937_64 engine(7);
  for (int round = 0; round < 50; ++round) {
    const auto values = random_values(engine, 1 + static_cast<std::size_t>(2000.0 * uniform(engine)));
    Histogram histogram;
    for (const std::int64_t value : values) histogram.add(value);
    for (const double part : {0.0, 0.001, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999, 0.9999, 1.0})
      expect_three_digits(histogram.quantile(part), exact_quantile(values, part));
  }
}

TEST(Histogram, LeastMostAndMeanAreExact) {
  Histogram histogram;
  for (const std::int64_t value : std::vector<std::int64_t>{1'234'567'891, 3, 987'654'321'012})
    histogram.add(value);
  EXPECT_EQ(histogram.least(), 3);
  EXPECT_EQ(histogram.most(), 987'654'321'012);
  EXPECT_EQ(histogram.quantile(1.0), 987'654'321'012);
  EXPECT_DOUBLE_EQ(histogram.mean(), (1'234'567'891.0 + 3.0 + 987'654'321'012.0) / 3.0);
}

TEST(Histogram, MergedPartsAreTheWhole) {
  std::mt19937_64 engine(8);
  const auto values = random_values(engine, 5000);
  Histogram whole, merged, parts[3];
  for (std::size_t i = 0; i < values.size(); ++i) {
    whole.add(values[i]);
    parts[i % 3].add(values[i]);
  }
  for (const Histogram& part : parts) merged.merge(part);
  EXPECT_EQ(merged.count(), whole.count());
  EXPECT_EQ(merged.least(), whole.least());
  EXPECT_EQ(merged.most(), whole.most());
  for (double part = 0.0; part <= 1.0; part += 0.01) EXPECT_EQ(merged.quantile(part), whole.quantile(part));
}

TEST(Histogram, OfNoValuesSaysZero) {
  Histogram histogram;
  EXPECT_EQ(histogram.quantile(0.99), 0);
  EXPECT_EQ(histogram.mean(), 0.0);
  histogram.add(5);
  histogram.clear();
  EXPECT_EQ(histogram.count(), 0u);
  EXPECT_EQ(histogram.most(), 0);
  EXPECT_TRUE(histogram.steps().empty());
}

TEST(Histogram, TakesTheEndsOfItsRange) {
  Histogram histogram;
  histogram.add(-5);
  histogram.add(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(histogram.quantile(0.5), 0);
  EXPECT_EQ(histogram.quantile(1.0), std::numeric_limits<std::int64_t>::max());
}

TEST(Histogram, StepsAscendToTheWhole) {
  std::mt19937_64 engine(9);
  Histogram histogram;
  for (const std::int64_t value : random_values(engine, 1000)) histogram.add(value);
  const auto steps = histogram.steps();
  for (std::size_t i = 1; i < steps.size(); ++i) {
    EXPECT_GT(steps[i].value, steps[i - 1].value);
    EXPECT_GT(steps[i].part, steps[i - 1].part);
  }
  EXPECT_DOUBLE_EQ(steps.back().part, 1.0);
}

}  // namespace
}  // namespace marble::load
