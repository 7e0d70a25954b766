// A polynomial of degree two at most, as it grows while an expression is read.
#pragma once

#include <map>
#include <utility>

#include "marble/problem.h"

namespace marble::formats {

struct Quadratic {
  double constant = 0.0;
  std::map<Index, double> linear = {};
  std::map<std::pair<Index, Index>, double> products = {};  ///< of variables i <= j

  [[nodiscard]] static Quadratic of(double value) { return {value}; }
  [[nodiscard]] static Quadratic variable(Index index) { return {0.0, {{index, 1.0}}}; }
  /// 0, 1 or 2.
  [[nodiscard]] int degree() const { return !products.empty() ? 2 : !linear.empty() ? 1 : 0; }

  void add(const Quadratic& other, double factor = 1.0) {
    constant += factor * other.constant;
    for (const auto& [index, value] : other.linear) linear[index] += factor * value;
    for (const auto& [pair, value] : other.products) products[pair] += factor * value;
  }
  [[nodiscard]] Quadratic times(double factor) const {
    Quadratic result;
    if (factor != 0.0) result.add(*this, factor);
    return result;
  }
};

/// The product, if its degree is two at most.
[[nodiscard]] inline bool multiply(const Quadratic& a, const Quadratic& b, Quadratic& product) {
  if (a.degree() + b.degree() > 2) return false;
  product = a.times(b.constant);
  product.add(b.times(a.constant));
  product.constant = a.constant * b.constant;
  for (const auto& [i, left] : a.linear) {
    for (const auto& [j, right] : b.linear)
      product.products[{std::min(i, j), std::max(i, j)}] += left * right;
  }
  return true;
}

}  // namespace marble::formats
