// A dual active set method on orthogonal factors (Goldfarb and Idnani, "A numerically stable dual method for
// solving strictly convex quadratic programs", 1983), for small convex QPs with nearly dependent rows. No
// penalty limits the multipliers: rows within e of parallel need multipliers of 1/e², while the error of the
// factors grows only with 1/e.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "model/interrupt.h"
#include "search/row_access.h"

namespace marble {

class DenseActiveSet {
 public:
  enum class Kind : std::uint8_t { equality, inequality, ignored };
  enum class End {
    optimal,
    infeasible,  ///< to rounding; not a proof
    stopped,     ///< interrupted, or after too many steps
  };

  explicit DenseActiveSet(const ScaledProblem& problem);

  /// Factorizes Q + δI for all following solves. Returns false if it is not positive definite to rounding.
  [[nodiscard]] bool factor(double delta);
  /// Solves min ½zᵀQz + gᵀz + ½δ|z − center|² over the rows, with a kind for each row of RowAccess.
  [[nodiscard]] End solve(const std::vector<Kind>& kinds, ConstVectorRef center, const Interrupt& interrupt);

  [[nodiscard]] const Vector& z() const { return z_; }
  /// Returns the rows held at zero, which are linearly independent, and their multipliers: Qz + g + Σ λ row =
  /// 0, so λ ≤ 0 for inequalities.
  [[nodiscard]] const std::vector<Index>& held() const { return held_; }
  [[nodiscard]] Vector multipliers() const;

 private:
  [[nodiscard]] Index most_violated() const;
  [[nodiscard]] End take(Index row);
  void find_direction(const Vector& normal);
  void append(Index row, double multiplier, double sign);
  void drop(Eigen::Index at);

  const ScaledProblem& problem_;
  RowAccess rows_;
  std::vector<Kind> kinds_;
  double delta_ = 0.0;
  Eigen::MatrixXd inverse_;  // L⁻ᵀ of Q + δI = L Lᵀ
  Eigen::MatrixXd basis_;    // L⁻ᵀ times an orthogonal matrix: the first columns span the held rows
  Eigen::MatrixXd upper_;    // basisᵀ times the held rows, upper triangular
  std::vector<Index> held_;
  std::vector<double> multiplier_, sign_;  // ≥ 0 for inequalities; an equality may be held with opposite sign
  std::vector<std::uint8_t> satisfied_;    // held, or dependent and violated only by rounding
  Vector z_, image_, direction_, rates_;
  bool dependent_ = false;
  int steps_left_ = 0;
};

}  // namespace marble
