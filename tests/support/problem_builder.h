// Builds small problems row by row.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "support/small_problems.h"

namespace marble::testing {

/// Takes dense rows whose last entry is the constant.
class ProblemBuilder {
 public:
  using Row = std::vector<double>;

  ProblemBuilder(std::string name, Row gradient) {
    p_.name = std::move(name);
    p_.g = std::move(gradient);
  }
  /// Adds ½ factor z_i z_j + ½ factor z_j z_i, or ½ factor z_i² for i = j.
  ProblemBuilder& quadratic(Index i, Index j, double factor) {
    hessian_.add(i, j, factor);
    if (i != j) hessian_.add(j, i, factor);
    return *this;
  }
  ProblemBuilder& constant(double c0) { return p_.c0 = c0, *this; }
  ProblemBuilder& equal(const Row& row) { return add(row, equalities_, p_.b); }
  ProblemBuilder& at_least(const Row& row) { return add(row, inequalities_, p_.d); }
  ProblemBuilder& pair(const Row& left, const Row& right) {
    return add(left, left_, p_.l).add(right, right_, p_.r);
  }

  [[nodiscard]] SmallProblem optimum(double value) {
    const auto n = static_cast<Index>(p_.g.size());
    p_.Q = compress(n, n, hessian_, "Q").value();
    p_.A = compress(static_cast<Index>(p_.b.size()), n, equalities_, "A").value();
    p_.C = compress(static_cast<Index>(p_.d.size()), n, inequalities_, "C").value();
    p_.L = compress(static_cast<Index>(p_.l.size()), n, left_, "L").value();
    p_.R = compress(static_cast<Index>(p_.r.size()), n, right_, "R").value();
    return {p_, value};
  }

 private:
  ProblemBuilder& add(const Row& row, Triplets& entries, std::vector<double>& offsets) {
    for (std::size_t j = 0; j + 1 < row.size(); ++j) {
      if (row[j] != 0.0) entries.add(static_cast<Index>(offsets.size()), static_cast<Index>(j), row[j]);
    }
    offsets.push_back(row.back());
    return *this;
  }

  OwnedProblem p_;
  Triplets hessian_, equalities_, inequalities_, left_, right_;
};

}  // namespace marble::testing
