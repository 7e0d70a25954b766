// Provides the merit of a point: S(x) = θ + Σ μ |c_E| + Σ μ max(0, −c_I) + Σ μ φ(G, H). φ of a pair is the
// least ℓ₁ change of its two sides that makes it complementary, so the elastic subproblem minimizes exactly
// the model of S.
#pragma once

#include <span>
#include <vector>

#include "marble/nonlinear.h"

namespace marble::nonlinear {

/// max(0, −G) + max(0, −H) + max(0, min(G, H))
[[nodiscard]] double pair_violation(double G, double H);

/// The four kinds of rows: at a point, or of its linearisation at a step.
struct Rows {
  std::span<const double> equalities, inequalities, G, H;
};

/// Returns the largest violation of any row.
[[nodiscard]] double largest_violation(const Rows& rows);

/// The weights μ of each row and of each pair.
class Weights {
 public:
  Weights(const Rows& rows, double first);

  /// Sets max{|π|, ½(μ + |π|)} and slightly more: strictly above the multipliers (murty-nlp-lectures, MSQP).
  void rise_above(const Multipliers& multipliers);
  void multiply(double factor);
  [[nodiscard]] double most() const;
  /// Σ μ · violation
  [[nodiscard]] double penalty(const Rows& rows) const;

  [[nodiscard]] std::span<const double> equalities() const { return equalities_; }
  [[nodiscard]] std::span<const double> inequalities() const { return inequalities_; }
  [[nodiscard]] std::span<const double> pairs() const { return pairs_; }

 private:
  std::vector<double> equalities_, inequalities_, pairs_;
};

}  // namespace marble::nonlinear
