// Provides the LCQP of a step d at a point: its pattern is set once, its numbers repeatedly.
//
//   min ∇θᵀd + ½ dᵀBd   s.t.   c_E + ∇c_E d = 0,   c_I + ∇c_I d ≥ 0,   0 ≤ G + ∇G d ⊥ H + ∇H d ≥ 0,
//                              |d_j| ≤ Δ_j
//
// The elastic one adds variables for the violation of each row, at the row's weight: d = 0 is always
// feasible.
#pragma once

#include <vector>

#include "nonlinear/functions.h"
#include "nonlinear/merit.h"

namespace marble::nonlinear {

/// The solution of a subproblem, and the linearized rows at it.
struct Step {
  std::vector<double> d;
  double size = 0.0;  // max |d_j| / scale_j
  Multipliers multipliers;
  std::vector<double> equalities, inequalities, G, H;  // c + ∇c d
  std::optional<bool> b_stationary;
  Stationarity stationarity = Stationarity::unknown;
  SecondOrder second_order = SecondOrder::unknown;
  bool elastic = false;

  [[nodiscard]] Rows rows() const { return {equalities, inequalities, G, H}; }
};

/// Returns views of a point's rows.
[[nodiscard]] inline Rows rows_of(const Point& point) {
  return {point.equalities, point.inequalities, point.G, point.H};
}

/// The range of steps: bounds and trust region.
struct Box {
  std::span<const double> lower, upper, scale;
  double radius = 0.0;
};

/// What a session scales by: the largest slope, and the largest entry of each variable's column in B.
struct Sizes {
  double slope = 0.0;
  std::vector<double> curvature;
};

class Subproblem {
 public:
  Subproblem(const Linearisation& at, const SparseMatrix& B, bool elastic);

  /// The problem with the last numbers set.
  [[nodiscard]] ProblemView view() const;
  [[nodiscard]] ProblemUpdate update() const;

  void sizes(Sizes& of) const;

  /// Sets all numbers. Without an objective only the elastic part of the cost remains.
  void set(const Point& point, const Linearisation& at, const SparseMatrix& B, const Box& box);
  /// Sets other offsets of the equalities only, and returns that update.
  [[nodiscard]] ProblemUpdate set_equalities(const Point& point);
  void set_weights(const Weights& weights);
  void drop_objective();
  /// Offsets the rows so that the step meets their true values at its end: the second-order correction.
  void correct(const Point& trial, const Step& step);

  /// True if the step 0 meets all rows within the tolerances of the options.
  [[nodiscard]] bool allows_no_step(const Options& options) const;
  /// The cost of the step 0.
  [[nodiscard]] double cost_of_no_step() const { return problem_.c0; }

  /// Converts a solution to a step.
  void read(const Solution& solution, const Point& point, const Linearisation& at, const Box& box,
            Step& step) const;

 private:
  OwnedProblem problem_;
  std::size_t n_, equalities_, inequalities_, pairs_;
  bool elastic_;
};

}  // namespace marble::nonlinear
