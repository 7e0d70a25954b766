// Initial-value embedding: the caller's problem with rows of c_E for all that is measured, which hold the
// measurement in their offsets alone.
#pragma once

#include <span>
#include <vector>

#include "marble/real_time.h"
#include "nonlinear/functions.h"

namespace marble::nonlinear {

/// Stays where it is: the problem's functions refer to it.
class Embedding {
 public:
  Embedding(const Problem& problem, const Measured& measured);
  Embedding(const Embedding&) = delete;
  Embedding& operator=(const Embedding&) = delete;

  /// Whether the variables are some, each once. The rows are checked once there are values.
  [[nodiscard]] Expected<void> check() const;
  [[nodiscard]] Expected<void> check_rows(const Point& point) const;

  /// With a row x_j of c_E for each variable that is measured, after the caller's own.
  [[nodiscard]] const Problem& problem() const { return embedded_; }
  [[nodiscard]] std::size_t size() const { return measured_.variables.size() + measured_.equalities.size(); }
  /// Rows that were added.
  [[nodiscard]] std::size_t variables() const { return measured_.variables.size(); }
  /// The row of the k-th measured number.
  [[nodiscard]] std::size_t row(std::size_t k, const Point& point) const;

 private:
  [[nodiscard]] Values values(std::span<const double> x);
  [[nodiscard]] Derivatives derivatives(std::span<const double> x);

  Problem given_;
  Measured measured_;
  Problem embedded_;
  std::vector<double> equalities_;
  SparseMatrix jacobian_;
  std::vector<Index> row_of_;  // of a variable, among those added; -1
  Multipliers multipliers_;    // the caller's rows alone
};

}  // namespace marble::nonlinear
