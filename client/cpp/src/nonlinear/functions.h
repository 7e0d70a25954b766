// What the caller's functions give, checked and kept: the loop sees no other numbers.
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
  double objective = 0.0;  // with the residuals' part
  std::vector<double> equalities, inequalities, G, H, residuals;
  std::optional<Error> fault;  // what is not finite, and where
};

/// Derivatives at a point, every matrix with its column pointers.
struct Linearisation {
  std::vector<double> gradient;  // with the residuals' part
  SparseMatrix equalities, inequalities, G, H, residuals;
  std::optional<Error> fault;  // what is not finite, and where
};

class Functions {
 public:
  /// Checks the problem's arrays and makes them complete. The problem must outlive it.
  [[nodiscard]] static Expected<Functions> create(const Problem& problem);

  /// Of point.x. Numbers that are not finite are no error yet: a step that came there may be shortened.
  [[nodiscard]] Expected<void> values(Point& point);
  /// Of a point whose values are there. The first call fixes the patterns. Not finite: as of values.
  [[nodiscard]] Expected<void> derivatives(const Point& point, Linearisation& linearisation);
  /// Entries may be infinite, or no numbers.
  [[nodiscard]] Expected<void> hessian(const Point& point, const Multipliers& multipliers,
                                       SparseMatrix& upper);
  /// Moves what is at a bound off it, by a hundredth of its scale or of its range. False where nothing is.
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
  std::optional<std::array<std::size_t, 5>> rows_;  // of each part, as at the first point
};

}  // namespace marble::nonlinear
