// Provides a polynomial of degree at most two, built while an expression is read.
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
  /// Returns 0, 1 or 2.
  [[nodiscard]] int degree() const { return !products.empty() ? 2 : !linear.empty() ? 1 : 0; }

  [[nodiscard]] std::size_t terms() const { return linear.size() + products.size(); }

  /// Takes the time of the smaller operand if possible: long sums are nested to the right.
  void add(Quadratic other, double factor = 1.0) {
    if (factor == 1.0 && other.terms() > terms()) std::swap(*this, other);
    constant += factor * other.constant;
    for (const auto& [index, value] : other.linear) linear[index] += factor * value;
    for (const auto& [pair, value] : other.products) products[pair] += factor * value;
  }
  [[nodiscard]] Quadratic times(double factor) const {
    if (factor == 0.0) return {};
    Quadratic result = *this;
    result.constant *= factor;
    for (auto& [index, value] : result.linear) value *= factor;
    for (auto& [pair, value] : result.products) value *= factor;
    return result;
  }
};

/// Computes the product if its degree is at most two.
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
