#include "global/row_proof.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/tuning.h"

namespace marble {

RowProof::RowProof(const ScaledProblem& problem, ProximalSystem& system)
    : problem_(problem),
      system_(system),
      dual_bound_(problem),
      weights_(problem),
      right_z_(problem.variables()),
      right_y_(problem.equalities()),
      slacks_(problem.layout.size()) {}

double RowProof::bound(const Box& box, ConstVectorRef z, const Vector& multipliers, double enough) {
  z_ = z;
  y_ = Vector::Zero(problem_.equalities());
  double best = -std::numeric_limits<double>::infinity();
  double paid = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < tuning::tree_passes && best < enough; ++pass) {
    if (!system_.minimize(multipliers, z_, y_)) break;
    best = std::max(best, dual_bound_.of_objective(box, z_, y_, multipliers));
    const double last = std::exchange(paid, dual_bound_.paid());
    if (std::isfinite(paid) && (paid <= tuning::exactness * (1.0 + std::abs(best)) || paid > 0.5 * last))
      break;
  }
  return best;
}

// Computes the optimum that holds the rows with a multiplier, by the method of multipliers: proximal steps
// with one factor.
bool RowProof::hold(ConstVectorRef z, const Vector& multipliers) {
  held_multipliers_ = multipliers;
  weights_.rho = tuning::exact_rho;
  weights_.delta = tuning::elastic_delta;
  weights_.rows.all =
      (multipliers.array() != 0.0).select(Vector::Constant(multipliers.size(), tuning::exact_rho), 0.0);
  ++factorizations_;
  if (!system_.kkt().factor(weights_)) return false;
  z_ = z;
  y_ = Vector::Zero(problem_.equalities());
  for (int step = 0; step < tuning::few_passes; ++step) {
    multiply(problem_.rows, z_, slacks_);
    slacks_ += problem_.offset;
    held_multipliers_ -= weights_.rows.all.cwiseProduct(slacks_);
    multiply(problem_.Q, z_, right_z_);
    right_z_ += problem_.g;
    add_transposed(problem_.A, y_, right_z_);
    add_transposed(problem_.rows, -held_multipliers_, right_z_);
    right_z_ = -right_z_;
    multiply(problem_.A, z_, right_y_);
    right_y_ = -right_y_ - problem_.b;
    if (!system_.kkt().solve(right_z_, right_y_) || !right_z_.allFinite()) return false;
    z_ += right_z_;
    y_ += right_y_;
    multiply(problem_.rows, right_z_, slacks_);
    held_multipliers_ -= weights_.rows.all.cwiseProduct(slacks_);
  }
  return true;
}

// Computes the y for which Aᵀy − Jᵀμ is the residual at the minimum along the ray, −(Q + δI)x, which is zero
// if the rows contradict each other.
bool RowProof::contradicts(const Box& box, const Vector& multipliers) {
  const double size = max_abs(multipliers);
  if (!(size > 0.0) || !std::isfinite(size)) return false;
  ray_ = multipliers / size;
  y_ = Vector::Zero(problem_.equalities());
  for (int pass = 0; pass < tuning::proof_passes; ++pass) {
    right_z_.setZero();
    add_transposed(problem_.rows, ray_, right_z_);
    add_transposed(problem_.A, -y_, right_z_);
    right_y_.setZero();
    if (!system_.solve(right_z_, right_y_)) return false;
    y_ += right_y_;
    if (dual_bound_.contradicts(box, y_, ray_)) return true;
  }
  return false;
}

}  // namespace marble
