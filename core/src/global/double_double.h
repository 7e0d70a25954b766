// Numbers with twice the precision: the sum of two doubles, the second less than half a unit in the last
// place of the first (Dekker, "A floating-point technique for extending the available precision", 1971). In
// products and quotients, the last two or three of 106 bits may be wrong.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace marble {

struct DoubleDouble {
  double high = 0.0, low = 0.0;

  DoubleDouble() = default;
  DoubleDouble(double value) : high(value) {}  // NOLINT(google-explicit-constructor): as a double is

  explicit operator double() const { return high; }

  /// Returns a + b; requires |a| ≥ |b|.
  [[nodiscard]] static DoubleDouble of_sum(double a, double b) {
    DoubleDouble sum(a + b);
    sum.low = b - (sum.high - a);
    return sum;
  }

  DoubleDouble operator-() const {
    DoubleDouble negative(-high);
    negative.low = -low;
    return negative;
  }
  DoubleDouble& operator+=(const DoubleDouble& other) {
    const double sum = high + other.high;
    const double part = sum - high;
    const double error = (high - (sum - part)) + (other.high - part);
    return *this = of_sum(sum, error + low + other.low);
  }
  DoubleDouble& operator-=(const DoubleDouble& other) { return *this += -other; }
  DoubleDouble& operator*=(const DoubleDouble& other) {
    const double product = high * other.high;
    const double error = std::fma(high, other.high, -product);
    return *this = of_sum(product, error + (high * other.low + low * other.high));
  }
  DoubleDouble& operator/=(const DoubleDouble& other) {
    const double first = high / other.high;
    DoubleDouble rest = *this;
    rest -= DoubleDouble(first) *= other;
    return *this = of_sum(first, rest.high / other.high);
  }
  friend DoubleDouble operator+(DoubleDouble a, const DoubleDouble& b) { return a += b; }
  friend DoubleDouble operator-(DoubleDouble a, const DoubleDouble& b) { return a -= b; }
  friend DoubleDouble operator*(DoubleDouble a, const DoubleDouble& b) { return a *= b; }
  friend DoubleDouble operator/(DoubleDouble a, const DoubleDouble& b) { return a /= b; }

  friend bool operator==(const DoubleDouble& a, const DoubleDouble& b) = default;
  friend bool operator<(const DoubleDouble& a, const DoubleDouble& b) {
    return a.high < b.high || (a.high == b.high && a.low < b.low);
  }
  friend bool operator>(const DoubleDouble& a, const DoubleDouble& b) { return b < a; }
  friend bool operator<=(const DoubleDouble& a, const DoubleDouble& b) { return a < b || a == b; }
  friend bool operator>=(const DoubleDouble& a, const DoubleDouble& b) { return b <= a; }
};

[[nodiscard]] inline DoubleDouble abs(const DoubleDouble& a) { return a.high < 0.0 ? -a : a; }

}  // namespace marble

template <>
struct Eigen::NumTraits<marble::DoubleDouble> : Eigen::GenericNumTraits<marble::DoubleDouble> {
  using Real = marble::DoubleDouble;
  using NonInteger = marble::DoubleDouble;
  using Nested = marble::DoubleDouble;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 2,
    AddCost = 10,
    MulCost = 6
  };
};
