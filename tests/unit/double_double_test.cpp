// Numbers of twice the precision, against integers of which doubles hold the halves.
#include "global/double_double.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "random_vector.h"

namespace marble {
namespace {

// Relative, of a sum, a product or a quotient.
constexpr double kPrecision = 0x1p-102;

double distance(const DoubleDouble& a, const DoubleDouble& b) {
  const DoubleDouble difference = abs(a - b);
  return difference.high / std::max(1e-300, std::abs(b.high));
}

TEST(DoubleDouble, HoldsWhatADoubleRounds) {
  const DoubleDouble sum = DoubleDouble(1.0) + DoubleDouble(0x1p-80);
  EXPECT_EQ(sum.high, 1.0);
  EXPECT_EQ(sum.low, 0x1p-80);
  EXPECT_EQ((sum - DoubleDouble(1.0)).high, 0x1p-80);
}

TEST(DoubleDouble, MultipliesExactlyWhatFits) {
  const DoubleDouble a = DoubleDouble(0x1p53) + DoubleDouble(-1.0);
  const DoubleDouble square = a * a;  // 2¹⁰⁶ − 2⁵⁴ + 1
  EXPECT_EQ(square - DoubleDouble(0x1p106) + DoubleDouble(0x1p54), DoubleDouble(1.0));
}

TEST(DoubleDouble, ProductsAndQuotientsUndoEachOther) {
  testing::RandomVectors random(1);
  const Vector high = random.next(400);
  const Vector low = random.next(400);
  for (Index i = 0; i + 1 < 400; i += 2) {
    const DoubleDouble a = DoubleDouble(high[i]) + DoubleDouble(0x1p-54 * low[i]);
    const DoubleDouble b = DoubleDouble(high[i + 1]) + DoubleDouble(0x1p-54 * low[i + 1]);
    EXPECT_LE(distance(a / b * b, a), 4.0 * kPrecision) << high[i] << " " << high[i + 1];
    EXPECT_LE(distance(a + b - b, a), 4.0 * kPrecision * (1.0 + std::abs(high[i + 1] / high[i])));
  }
}

TEST(DoubleDouble, ComparesByBothHalves) {
  const DoubleDouble one = 1.0;
  const DoubleDouble more = one + DoubleDouble(0x1p-90);
  EXPECT_LT(one, more);
  EXPECT_GT(more, one);
  EXPECT_LE(one, one);
  EXPECT_LT(abs(-one), more);
  EXPECT_EQ(abs(-more), more);
}

}  // namespace
}  // namespace marble
