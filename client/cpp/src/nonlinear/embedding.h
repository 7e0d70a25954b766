// Provides initial-value embedding: the caller's problem with rows of c_E for all measured quantities, which
// contain the measurement only in their offsets.
#pragma once

#include <span>
#include <vector>

#include "marble/real_time.h"
#include "nonlinear/functions.h"

namespace marble::nonlinear {

/// Must not move: the problem's functions refer to it.
class Embedding {
 public:
  Embedding(const Problem& problem, const Measured& measured);
  Embedding(const Embedding&) = delete;
  Embedding& operator=(const Embedding&) = delete;

  /// Checks that at least one variable is given, each once. The rows are checked once there are values.
  [[nodiscard]] Expected<void> check() const;
  [[nodiscard]] Expected<void> check_rows(const Point& point) const;

  /// Has a row x_j of c_E for each measured variable, after the caller's own rows.
  [[nodiscard]] const Problem& problem() const { return embedded_; }
  [[nodiscard]] std::size_t size() const { return measured_.variables.size() + measured_.equalities.size(); }
  /// Returns the number of added rows.
  [[nodiscard]] std::size_t variables() const { return measured_.variables.size(); }
  /// Returns the row of the k-th measured number.
  [[nodiscard]] std::size_t row(std::size_t k, const Point& point) const;

 private:
  [[nodiscard]] Values values(std::span<const double> x);
  [[nodiscard]] Derivatives derivatives(std::span<const double> x);

  Problem given_;
  Measured measured_;
  Problem embedded_;
  std::vector<double> equalities_;
  SparseMatrix jacobian_;
  std::vector<Index> row_of_;  // of a variable, among the added ones; −1
  Multipliers multipliers_;    // of the caller's rows alone
};

}  // namespace marble::nonlinear
