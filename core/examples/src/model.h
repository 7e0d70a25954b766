// Builds an LCQP in mathematical notation: rows of terms, squares of terms.
#pragma once

#include <string>
#include <vector>

#include "marble/problem.h"

namespace marble::examples {

struct Term {
  Index variable;
  double factor;
};
using Terms = std::vector<Term>;

class Model {
 public:
  Model(std::string name, Index variables);

  void equal_zero(const Terms& terms, double constant = 0.0) { equalities_.add(terms, constant); }
  void at_least_zero(const Terms& terms, double constant = 0.0) { inequalities_.add(terms, constant); }
  /// Adds −bound ≤ terms ≤ bound.
  void within(const Terms& terms, double bound);
  /// Adds 0 ≤ s ⊥ t ≥ 0.
  void complementary(const Terms& s, double s_constant, const Terms& t, double t_constant);
  /// Adds ½ weight (terms + constant)² to the objective.
  void add_square(double weight, const Terms& terms, double constant = 0.0);

  /// Adds weight · variable to the objective.
  void add_linear(double weight, Index variable) { gradient_[static_cast<std::size_t>(variable)] += weight; }

  [[nodiscard]] OwnedProblem problem() const;

 private:
  struct Rows {
    Triplets entries;
    std::vector<double> constants;
    void add(const Terms& terms, double constant);
  };
  [[nodiscard]] SparseMatrix matrix(const Rows& rows, const char* name) const;

  std::string name_;
  Index variables_;
  double constant_ = 0.0;
  std::vector<double> gradient_;
  Triplets hessian_;
  Rows equalities_, inequalities_, left_, right_;
};

/// Returns the terms of the sum of two rows.
[[nodiscard]] inline Terms operator+(Terms a, const Terms& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

}  // namespace marble::examples
