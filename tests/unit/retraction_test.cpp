#include "model/retraction.h"

#include <gtest/gtest.h>

#include <random>

namespace marble {
namespace {

constexpr double kKappas[] = {1e-20, 1e-12, 1e-4, 0.1, 1.0, 10.0, 1e6};
constexpr double kSigmas[] = {-1e12, -1e6, -3.0, -1e-3, -1e-9, 0.0, 1e-9, 1e-3, 3.0, 1e6, 1e12};

TEST(Softplus, KeepsTheProductAtKappaAndBothSidesPositive) {
  for (const double kappa : kKappas) {
    for (const double sigma : kSigmas) {
      const Softplus p(sigma, kappa);
      EXPECT_GT(p.positive, 0.0) << sigma << ' ' << kappa;
      EXPECT_GT(p.negative, 0.0) << sigma << ' ' << kappa;
      EXPECT_NEAR(p.positive * p.negative / kappa, 1.0, 1e-15) << sigma << ' ' << kappa;
    }
  }
}

TEST(Softplus, DifferenceOfTheSidesIsSigma) {
  for (const double kappa : kKappas) {
    for (const double sigma : kSigmas) {
      const Softplus p(sigma, kappa);
      EXPECT_NEAR(p.positive - p.negative, sigma, 1e-15 * (std::abs(sigma) + std::sqrt(kappa)));
    }
  }
}

TEST(Softplus, SlopesAreTheFiniteDifferencesAndSumToOne) {
  for (const double kappa : {1e-4, 0.1, 10.0}) {
    for (const double sigma : {-2.0, -0.1, 0.0, 0.3, 5.0}) {
      const double h = 1e-6 * (1.0 + std::abs(sigma));
      const Softplus p(sigma, kappa);
      const double difference =
          (Softplus(sigma + h, kappa).positive - Softplus(sigma - h, kappa).positive) / (2.0 * h);
      EXPECT_NEAR(p.slope(), difference, 1e-7);
      EXPECT_NEAR(p.slope() + p.negative_slope(), 1.0, 1e-15);
      EXPECT_NEAR(p.negative_slope(), Softplus(-sigma, kappa).slope(), 1e-15);
    }
  }
}

TEST(Softplus, CurvatureIsTheFiniteDifferenceOfTheSlopeAndEven) {
  for (const double kappa : {1e-2, 0.1, 10.0}) {
    for (const double sigma : {-2.0, -0.1, 0.0, 0.3, 5.0}) {
      const double h = 1e-6;
      const double difference =
          (Softplus(sigma + h, kappa).slope() - Softplus(sigma - h, kappa).slope()) / (2.0 * h);
      EXPECT_NEAR(Softplus(sigma, kappa).curvature(), difference, 1e-6);
      EXPECT_DOUBLE_EQ(Softplus(sigma, kappa).curvature(), Softplus(-sigma, kappa).curvature());
    }
  }
}

TEST(Softplus, HoldsItsPromisesOverAllMagnitudes) {
  std::mt19937_64 source(1);
  std::uniform_real_distribution<double> kappa_power(-20.0, 6.0), sigma_power(-20.0, 12.0);
  for (int i = 0; i < 10000; ++i) {
    const double kappa = std::pow(10.0, kappa_power(source));
    const double sigma = (i % 2 == 0 ? 1.0 : -1.0) * std::pow(10.0, sigma_power(source));
    const Softplus p(sigma, kappa);
    ASSERT_GT(p.positive, 0.0) << sigma << ' ' << kappa;
    ASSERT_GT(p.negative, 0.0) << sigma << ' ' << kappa;
    ASSERT_NEAR(p.positive * p.negative / kappa, 1.0, 5e-16) << sigma << ' ' << kappa;
    ASSERT_NEAR(p.slope() + p.negative_slope(), 1.0, 5e-16) << sigma << ' ' << kappa;
    ASSERT_GE(p.curvature(), 0.0) << sigma << ' ' << kappa;
    const Softplus mirror(-sigma, kappa);
    ASSERT_EQ(p.positive, mirror.negative);
    ASSERT_EQ(p.curvature(), mirror.curvature());
  }
}

TEST(Softplus, DerivativesAreFiniteDifferencesInTheScaleOfKappa) {
  // p(σ; κ) = √κ·p(σ/√κ; 1): relative differences must agree at every κ.
  for (const double kappa : kKappas) {
    const double unit = std::sqrt(kappa);
    for (const double x : {-30.0, -2.0, -0.1, 0.0, 0.3, 5.0, 30.0}) {
      const double h = 1e-5 * unit;
      const Softplus p(x * unit, kappa), above(x * unit + h, kappa), below(x * unit - h, kappa);
      EXPECT_NEAR((above.positive - below.positive) / (2.0 * h), p.slope(), 1e-8) << x << ' ' << kappa;
      EXPECT_NEAR((above.slope() - below.slope()) / (2.0 * h) * unit, p.curvature() * unit, 1e-8)
          << x << ' ' << kappa;
    }
  }
}

TEST(Softplus, SlopeOfTheSmallSideKeepsItsDigits) {
  // p′(σ) → κ/σ² for σ → −∞; ½(1 + σ/√(σ² + 4κ)) would give 0 here.
  EXPECT_NEAR(Softplus(-1e10, 1e-8).slope() / 1e-28, 1.0, 1e-15);
  EXPECT_NEAR(Softplus(1e10, 1e-8).negative_slope() / 1e-28, 1.0, 1e-15);
}

TEST(Softplus, SmallSideKeepsItsDigitsFarFromTheCorner) {
  // ½(σ + √(σ² + 4κ)) would cancel to 0 here; κ/|σ| is the value to all digits.
  const Softplus p(-1e10, 1e-8);
  EXPECT_NEAR(p.positive / 1e-18, 1.0, 1e-15);
}

constexpr Retraction kBoth[] = {Retraction::softplus, Retraction::exponential};

TEST(PairCurve, SidesMultiplyToKappaAndAreTheDerivativesOfEitherRetraction) {
  for (const Retraction retraction : kBoth) {
    for (const double kappa : {1e-8, 1e-2, 1.0, 10.0}) {
      for (const double x : {-8.0, -2.0, -0.1, 0.0, 0.3, 5.0, 8.0}) {
        // The softplus bends at σ = √κ, the exponential at 1.
        const double unit = retraction == Retraction::softplus ? std::sqrt(kappa) : 1.0;
        const double h = 1e-5 * unit, sigma = x * unit;
        const PairCurve at(retraction, sigma, kappa), above(retraction, sigma + h, kappa),
            below(retraction, sigma - h, kappa);
        const double size = std::max(at.s, at.t) / unit;
        EXPECT_NEAR(at.s * at.t / kappa, 1.0, 1e-14);
        EXPECT_NEAR((above.s - below.s) / (2.0 * h), at.a(), 1e-8 * size) << x << ' ' << kappa;
        EXPECT_NEAR((above.t - below.t) / (2.0 * h), -at.b(), 1e-8 * size) << x << ' ' << kappa;
        const double s_bend = (above.a() - below.a()) / (2.0 * h);
        const double t_bend = (below.b() - above.b()) / (2.0 * h);
        EXPECT_NEAR(at.bend(3.0, -2.0), 3.0 * s_bend - 2.0 * t_bend, 1e-7 * size / unit) << x << ' ' << kappa;
      }
    }
  }
}

TEST(PairCurve, SigmaOfADifferenceIsWhereTheSidesDifferByIt) {
  for (const Retraction retraction : kBoth) {
    for (const double kappa : {1e-8, 1e-2, 1.0}) {
      for (const double difference : {-100.0, -1.0, 0.0, 1e-3, 7.0}) {
        const PairCurve at(retraction, PairCurve::sigma_of(retraction, difference, kappa), kappa);
        EXPECT_NEAR(at.s - at.t, difference, 1e-12 * (1.0 + std::abs(difference)));
      }
    }
  }
}

TEST(PairCurve, SlopesOfTheSoftplusAreBoundedAndThoseOfTheExponentialAreNot) {
  EXPECT_LT(PairCurve(Retraction::softplus, 30.0, 1e-4).a(), 1.0);
  EXPECT_GT(PairCurve(Retraction::exponential, 30.0, 1e-4).a(), 1e10);
}

}  // namespace
}  // namespace marble
