// Problems as formulas of jets, with what is known of them.
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "marble/nonlinear.h"

namespace marble::testing {

// A number with its gradient and Hessian: formulas written once give values and exact derivatives.
class Jet {
 public:
  Jet(double value = 0.0) : value_(value) {}  // a constant: no derivatives
  static Jet variable(double value, std::size_t index, std::size_t n) {
    Jet made(value);
    made.gradient_.assign(n, 0.0), made.hessian_.assign(n * n, 0.0);
    made.gradient_[index] = 1.0;
    return made;
  }

  [[nodiscard]] double value() const { return value_; }
  [[nodiscard]] double slope(std::size_t j) const { return gradient_.empty() ? 0.0 : gradient_[j]; }
  [[nodiscard]] double curvature(std::size_t i, std::size_t j) const {
    return hessian_.empty() ? 0.0 : hessian_[i * gradient_.size() + j];
  }

  /// f(u) of f's value and its first two derivatives.
  [[nodiscard]] Jet map(double f, double df, double ddf) const {
    Jet made = *this;
    made.value_ = f;
    const std::size_t n = gradient_.size();
    for (std::size_t i = 0; i < n; ++i) {
      made.gradient_[i] = df * gradient_[i];
      for (std::size_t j = 0; j < n; ++j)
        made.hessian_[i * n + j] = df * hessian_[i * n + j] + ddf * gradient_[i] * gradient_[j];
    }
    return made;
  }

  friend Jet operator+(const Jet& a, const Jet& b) {
    return combine(a, b, a.value_ + b.value_, 1.0, 1.0, 0.0);
  }
  friend Jet operator-(const Jet& a, const Jet& b) {
    return combine(a, b, a.value_ - b.value_, 1.0, -1.0, 0.0);
  }
  friend Jet operator*(const Jet& a, const Jet& b) {
    return combine(a, b, a.value_ * b.value_, b.value_, a.value_, 1.0);
  }
  friend Jet operator/(const Jet& a, const Jet& b) { return a * pow(b, -1.0); }
  friend Jet operator-(const Jet& a) { return Jet(0.0) - a; }
  Jet& operator+=(const Jet& b) { return *this = *this + b; }

  friend Jet pow(const Jet& a, double p) {
    return a.map(std::pow(a.value_, p), p * std::pow(a.value_, p - 1.0),
                 p * (p - 1.0) * std::pow(a.value_, p - 2.0));
  }
  friend Jet square(const Jet& a) { return a * a; }
  friend Jet sin(const Jet& a) { return a.map(std::sin(a.value_), std::cos(a.value_), -std::sin(a.value_)); }
  friend Jet cos(const Jet& a) { return a.map(std::cos(a.value_), -std::sin(a.value_), -std::cos(a.value_)); }
  friend Jet exp(const Jet& a) { return a.map(std::exp(a.value_), std::exp(a.value_), std::exp(a.value_)); }
  friend Jet log(const Jet& a) {
    return a.map(std::log(a.value_), 1.0 / a.value_, -1.0 / (a.value_ * a.value_));
  }

 private:
  // Of f with derivatives p and q by a and b, and the mixed one m.
  static Jet combine(const Jet& a, const Jet& b, double value, double p, double q, double m) {
    Jet made(value);
    const std::size_t n = a.gradient_.empty() ? b.gradient_.size() : a.gradient_.size();
    made.gradient_.resize(n), made.hessian_.resize(n * n);
    for (std::size_t i = 0; i < n; ++i) {
      made.gradient_[i] = p * a.slope(i) + q * b.slope(i);
      for (std::size_t j = 0; j < n; ++j)
        made.hessian_[i * n + j] = p * a.curvature(i, j) + q * b.curvature(i, j) +
                                   m * (a.slope(i) * b.slope(j) + b.slope(i) * a.slope(j));
    }
    return made;
  }

  double value_;
  std::vector<double> gradient_, hessian_;
};

using Jets = std::vector<Jet>;

/// The functions of a problem at x. Residuals count half their squares.
struct Parts {
  Jet objective = {};
  Jets equalities = {};
  Jets inequalities = {};
  Jets G = {};
  Jets H = {};
  Jets residuals = {};
};

inline constexpr double kFree = std::numeric_limits<double>::infinity();

struct Formula {
  std::string name;
  double optimum = 0.0;  // as published
  std::vector<double> start;
  std::function<Parts(const Jets& x)> parts;
  std::vector<double> lower = {};
  std::vector<double> upper = {};

  [[nodiscard]] Jets variables(std::span<const double> x) const;
};

/// With the Hessian of the Lagrangian, unless it is not wanted. All patterns are full.
[[nodiscard]] nonlinear::Problem problem_of(const Formula& formula, bool with_hessian = true);

/// What speaks against an answer by the formula alone: a row, a bound or a pair that is violated by more than
/// 1e-6, or an objective that is not that of x. Empty if nothing does.
[[nodiscard]] std::string objection(const Formula& formula, const nonlinear::Answer& answer);

[[nodiscard]] std::vector<Formula> classical_problems();
[[nodiscard]] std::vector<Formula> equilibrium_problems();

}  // namespace marble::testing
