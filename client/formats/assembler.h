// Builds an LCQP from the terms of other formats: two-sided rows, bounds on variables, pairs of affine rows.
#pragma once

#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble::formats {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Σ coefficient · variable + constant.
struct AffineRow {
  std::vector<std::pair<Index, double>> terms = {};
  double constant = 0.0;

  [[nodiscard]] static AffineRow variable(Index index, double constant = 0.0) {
    return {{{index, 1.0}}, constant};
  }
  [[nodiscard]] AffineRow negated() const;
};

class Assembler {
 public:
  explicit Assembler(Index variables) : g_(static_cast<std::size_t>(variables), 0.0) {}

  [[nodiscard]] Index variables() const { return static_cast<Index>(g_.size()); }
  /// Adds a variable after the existing ones.
  Index add_variable();

  /// Returns the number of rows or pairs so far: the index of the next one.
  [[nodiscard]] Index equalities() const { return equalities_.rows(); }
  /// As equalities().
  [[nodiscard]] Index inequalities() const { return inequalities_.rows(); }
  /// As equalities().
  [[nodiscard]] Index pairs() const { return left_.rows(); }

  void add_constant(double value) { c0_ += value; }
  void add_linear(Index variable, double coefficient) {
    g_[static_cast<std::size_t>(variable)] += coefficient;
  }
  /// Adds an entry of Q (both triangles must be given), in ½ zᵀQz.
  void add_quadratic(Index row, Index column, double value) { Q_.add(row, column, value); }

  /// Adds low <= row <= high: an equality if both are equal, nothing for a side of infinite_limit or more,
  /// row − low before high − row. `field` and `index` locate errors: NaN, or low > high.
  [[nodiscard]] Expected<void> add_range(const AffineRow& row, double low, double high, const char* field,
                                         std::int64_t index);
  /// Adds 0 <= left ⊥ right >= 0.
  void add_pair(const AffineRow& left, const AffineRow& right);
  /// Adds row ⊥ low <= variable <= high with finite low < high, in AMPL's meaning: row >= 0 at the lower
  /// bound, <= 0 at the upper one, 0 between them. Adds two variables, the parts p and q of the row, an
  /// equality row = p − q, and two pairs, p with the lower bound and q with the upper one.
  void add_mixed(const AffineRow& row, Index variable, double low, double high);

  /// Returns the assembled problem, checked as by Problem::create.
  [[nodiscard]] Expected<OwnedProblem> finish(const std::string& name) const;

 private:
  struct Part {
    Triplets entries;
    std::vector<double> offsets;
    void add(const AffineRow& row);
    [[nodiscard]] Index rows() const { return static_cast<Index>(offsets.size()); }
  };

  Triplets Q_;
  std::vector<double> g_;
  double c0_ = 0.0;
  Part equalities_, inequalities_, left_, right_;
};

}  // namespace marble::formats
