#include "nonlinear/merit.h"

#include <algorithm>
#include <cmath>

#include "nonlinear/algebra.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

double above(double weight, double multiplier) {
  return std::max(tuning::weight_margin,
                  std::max(multiplier, 0.5 * (weight + multiplier)) * (1.0 + tuning::weight_margin));
}

}  // namespace

double pair_violation(double G, double H) {
  return std::max(0.0, -G) + std::max(0.0, -H) + std::max(0.0, std::min(G, H));
}

double largest_violation(const Rows& rows) {
  double most = largest(rows.equalities);
  for (const double value : rows.inequalities) most = std::max(most, -value);
  for (std::size_t i = 0; i < rows.G.size(); ++i)
    most = std::max(most, std::abs(std::min(rows.G[i], rows.H[i])));
  return most;
}

Weights::Weights(const Rows& rows, double first)
    : equalities_(rows.equalities.size(), first),
      inequalities_(rows.inequalities.size(), first),
      pairs_(rows.G.size(), first) {}

void Weights::rise_above(const Multipliers& multipliers) {
  for (std::size_t i = 0; i < equalities_.size(); ++i)
    equalities_[i] = above(equalities_[i], std::abs(multipliers.equalities[i]));
  for (std::size_t i = 0; i < inequalities_.size(); ++i)
    inequalities_[i] = above(inequalities_[i], std::abs(multipliers.inequalities[i]));
  for (std::size_t i = 0; i < pairs_.size(); ++i)
    pairs_[i] = above(pairs_[i], std::max(std::abs(multipliers.G[i]), std::abs(multipliers.H[i])));
}

void Weights::multiply(double factor) {
  for (auto* part : {&equalities_, &inequalities_, &pairs_}) {
    for (double& weight : *part) weight *= factor;
  }
}

double Weights::most() const {
  return std::max({largest(equalities_), largest(inequalities_), largest(pairs_)});
}

double Weights::penalty(const Rows& rows) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < equalities_.size(); ++i) sum += equalities_[i] * std::abs(rows.equalities[i]);
  for (std::size_t i = 0; i < inequalities_.size(); ++i)
    sum += inequalities_[i] * std::max(0.0, -rows.inequalities[i]);
  for (std::size_t i = 0; i < pairs_.size(); ++i) sum += pairs_[i] * pair_violation(rows.G[i], rows.H[i]);
  return sum;
}

}  // namespace marble::nonlinear
