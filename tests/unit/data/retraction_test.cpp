#include "data/retraction.h"

#include <gtest/gtest.h>

#include <random>

namespace marble {
namespace {

constexpr double kKappas[] = {1e-20, 1e-12, 1e-4, 0.1, 1.0, 10.0, 1e6};
constexpr double kSigmas[] = {-1e12, -1e6, -3.0, -1e-3, -1e-9, 0.0, 1e-9, 1e-3, 3.0, 1e6, 1e12};

TEST(Retraction, KeepsTheProductAtKappaAndBothSidesPositive) {
  for (const double kappa : kKappas) {
    for (const double sigma : kSigmas) {
      const Retraction p(sigma, kappa);
      EXPECT_GT(p.positive, 0.0) << sigma << ' ' << kappa;
      EXPECT_GT(p.negative, 0.0) << sigma << ' ' << kappa;
      EXPECT_NEAR(p.positive * p.negative / kappa, 1.0, 1e-15) << sigma << ' ' << kappa;
    }
  }
}

TEST(Retraction, DifferenceOfTheSidesIsSigma) {
  for (const double kappa : kKappas) {
    for (const double sigma : kSigmas) {
      const Retraction p(sigma, kappa);
      EXPECT_NEAR(p.positive - p.negative, sigma, 1e-15 * (std::abs(sigma) + std::sqrt(kappa)));
    }
  }
}

TEST(Retraction, SlopesAreTheFiniteDifferencesAndSumToOne) {
  for (const double kappa : {1e-4, 0.1, 10.0}) {
    for (const double sigma : {-2.0, -0.1, 0.0, 0.3, 5.0}) {
      const double h = 1e-6 * (1.0 + std::abs(sigma));
      const Retraction p(sigma, kappa);
      const double difference =
          (Retraction(sigma + h, kappa).positive - Retraction(sigma - h, kappa).positive) / (2.0 * h);
      EXPECT_NEAR(p.slope(), difference, 1e-7);
      EXPECT_NEAR(p.slope() + p.negative_slope(), 1.0, 1e-15);
      EXPECT_NEAR(p.negative_slope(), Retraction(-sigma, kappa).slope(), 1e-15);
    }
  }
}

TEST(Retraction, CurvatureIsTheFiniteDifferenceOfTheSlopeAndEven) {
  for (const double kappa : {1e-2, 0.1, 10.0}) {
    for (const double sigma : {-2.0, -0.1, 0.0, 0.3, 5.0}) {
      const double h = 1e-6;
      const double difference =
          (Retraction(sigma + h, kappa).slope() - Retraction(sigma - h, kappa).slope()) / (2.0 * h);
      EXPECT_NEAR(Retraction(sigma, kappa).curvature(), difference, 1e-6);
      EXPECT_DOUBLE_EQ(Retraction(sigma, kappa).curvature(), Retraction(-sigma, kappa).curvature());
    }
  }
}

TEST(Retraction, HoldsItsPromisesOverAllMagnitudes) {
  std::mt19937_64 source(1);
  std::uniform_real_distribution<double> kappa_power(-20.0, 6.0), sigma_power(-20.0, 12.0);
  for (int i = 0; i < 10000; ++i) {
    const double kappa = std::pow(10.0, kappa_power(source));
    const double sigma = (i % 2 == 0 ? 1.0 : -1.0) * std::pow(10.0, sigma_power(source));
    const Retraction p(sigma, kappa);
    ASSERT_GT(p.positive, 0.0) << sigma << ' ' << kappa;
    ASSERT_GT(p.negative, 0.0) << sigma << ' ' << kappa;
    ASSERT_NEAR(p.positive * p.negative / kappa, 1.0, 5e-16) << sigma << ' ' << kappa;
    ASSERT_NEAR(p.slope() + p.negative_slope(), 1.0, 5e-16) << sigma << ' ' << kappa;
    ASSERT_GE(p.curvature(), 0.0) << sigma << ' ' << kappa;
    const Retraction mirror(-sigma, kappa);
    ASSERT_EQ(p.positive, mirror.negative);
    ASSERT_EQ(p.curvature(), mirror.curvature());
  }
}

TEST(Retraction, DerivativesAreFiniteDifferencesInTheScaleOfKappa) {
  // p(σ; κ) = √κ·p(σ/√κ; 1): relative differences must agree at every κ.
  for (const double kappa : kKappas) {
    const double unit = std::sqrt(kappa);
    for (const double x : {-30.0, -2.0, -0.1, 0.0, 0.3, 5.0, 30.0}) {
      const double h = 1e-5 * unit;
      const Retraction p(x * unit, kappa), above(x * unit + h, kappa), below(x * unit - h, kappa);
      EXPECT_NEAR((above.positive - below.positive) / (2.0 * h), p.slope(), 1e-8) << x << ' ' << kappa;
      EXPECT_NEAR((above.slope() - below.slope()) / (2.0 * h) * unit, p.curvature() * unit, 1e-8)
          << x << ' ' << kappa;
    }
  }
}

TEST(Retraction, SlopeOfTheSmallSideKeepsItsDigits) {
  // p′(σ) → κ/σ² for σ → −∞; ½(1 + σ/√(σ² + 4κ)) would give 0 here.
  EXPECT_NEAR(Retraction(-1e10, 1e-8).slope() / 1e-28, 1.0, 1e-15);
  EXPECT_NEAR(Retraction(1e10, 1e-8).negative_slope() / 1e-28, 1.0, 1e-15);
}

TEST(Retraction, SmallSideKeepsItsDigitsFarFromTheCorner) {
  // ½(σ + √(σ² + 4κ)) would cancel to 0 here; κ/|σ| is the value to all digits.
  const Retraction p(-1e10, 1e-8);
  EXPECT_NEAR(p.positive / 1e-18, 1.0, 1e-15);
}

}  // namespace
}  // namespace marble
