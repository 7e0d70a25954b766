// Checks and stores the results of the caller's functions: the loop uses no other numbers.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "marble/nonlinear.h"

namespace marble::nonlinear {

/// Values at a point.
struct Point {
  std::vector<double> x;
  double objective = 0.0;  // includes the residuals' part
  std::vector<double> equalities, inequalities, G, H, residuals;
  std::optional<Error> fault;  // which number is not finite
};

/// Derivatives at a point; every matrix has its column pointers.
struct Linearisation {
  std::vector<double> gradient;  // includes the residuals' part
  SparseMatrix equalities, inequalities, G, H, residuals;
  std::optional<Error> fault;  // which number is not finite
};

class Functions {
 public:
  /// Checks the problem's arrays and fills in the defaults. The problem must outlive it.
  [[nodiscard]] static Expected<Functions> create(const Problem& problem);

  /// Evaluates at point.x. Numbers that are not finite are no error yet: the step to them may be shortened.
  [[nodiscard]] Expected<void> values(Point& point);
  /// Evaluates at a point that has its values. The first call fixes the patterns. Not finite: as in values().
  [[nodiscard]] Expected<void> derivatives(const Point& point, Linearisation& linearisation);
  /// Evaluates the Hessian; entries may be infinite or NaN.
  [[nodiscard]] Expected<void> hessian(const Point& point, const Multipliers& multipliers,
                                       SparseMatrix& upper);
  /// Moves entries at a bound off it, by a hundredth of their scale or range. Returns false if there is none.
  [[nodiscard]] bool leave_bounds(std::vector<double>& x) const;

  [[nodiscard]] std::size_t variables() const { return start_.size(); }
  [[nodiscard]] std::span<const double> start() const { return start_; }  // within the bounds
  [[nodiscard]] std::span<const double> lower() const { return lower_; }
  [[nodiscard]] std::span<const double> upper() const { return upper_; }
  [[nodiscard]] std::span<const double> scale() const { return scale_; }
  [[nodiscard]] std::span<const Index> blocks() const { return blocks_; }
  [[nodiscard]] std::int32_t evaluations() const { return evaluations_; }
  [[nodiscard]] std::int32_t linearisations() const { return linearisations_; }

 private:
  Functions() = default;

  const Problem* problem_ = nullptr;
  std::vector<double> start_, lower_, upper_, scale_;
  std::vector<Index> blocks_;
  std::int32_t evaluations_ = 0, linearisations_ = 0;
  std::optional<std::array<std::size_t, 5>> rows_;  // of each part, from the first point
};

}  // namespace marble::nonlinear
