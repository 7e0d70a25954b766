#include "relaxation/relaxation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

Relaxation::Relaxation(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt, Gram& gram)
    : problem_(problem),
      system_(problem, std::move(kkt)),
      gram_(problem, gram, system_),
      set_(gram_),
      dual_bound_(problem),
      right_z_(problem.variables()),
      right_y_(problem.equalities()),
      signed_(problem.layout.size()) {}

bool Relaxation::prepare(Run& run) {
  system_.kkt().attend(run.interrupt());
  system_.kkt().load(problem_);
  ++run.factorizations;
  return run.timed(&Times::factorization_s,
                   [this] { return system_.factor(tuning::exact_rho, tuning::tree_delta); });
}

bool Relaxation::is_convex(Run& run) {
  ++run.factorizations;
  const bool convex = run.timed(&Times::factorization_s,
                                [this] { return system_.factor(tuning::rounding, tuning::rounding); });
  return convex && prepare(run);
}

bool Relaxation::start(ConstVectorRef z) {
  bound_ = -kInfinity;
  z_ = z;
  y_ = Vector::Zero(problem_.equalities());
  const Vector none = Vector::Zero(problem_.layout.size());
  set_.start(none, none);
  for (Index row = 0; row < problem_.layout.size(); ++row)
    set_.set_kind(row, DualActiveSet::RowKind::inequality);
  return move_center();
}

bool Relaxation::start(const Center& center, const std::vector<Index>& held, double parent_bound) {
  bound_ = parent_bound;
  z_ = z_center_ = center.z;
  y_ = y_center_ = center.y;
  for (Index row = 0; row < problem_.layout.size(); ++row)
    set_.set_kind(row, DualActiveSet::RowKind::inequality);
  set_.start(center.multipliers, center.slacks);
  return set_.hold(held);
}

// The minimum around the center for the multipliers at hand.
bool Relaxation::find_point() {
  multiply(problem_.Q, z_center_, right_z_);
  right_z_ += problem_.g;
  add_transposed(problem_.A, y_center_, right_z_);
  add_transposed(problem_.rows, -set_.multipliers(), right_z_);
  right_z_ = -right_z_;
  multiply(problem_.A, z_center_, right_y_);
  right_y_ = -right_y_ - problem_.b;
  if (!system_.solve(right_z_, right_y_)) return false;
  z_ = z_center_ + right_z_;
  y_ = y_center_ + right_y_;
  return true;
}

bool Relaxation::move_center() {
  z_center_ = z_;
  y_center_ = y_;
  if (!find_point()) return false;
  Vector slacks(problem_.layout.size());
  multiply(problem_.rows, z_, slacks);
  slacks += problem_.offset;
  return set_.recenter(slacks);
}

double Relaxation::evaluate_bound(const Box& box) {
  signed_ = set_.multipliers();
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    if (set_.kind(row) != DualActiveSet::RowKind::fixed) signed_[row] = std::max(signed_[row], 0.0);
  }
  return dual_bound_.of_objective(box, z_, y_, signed_);
}

// The ray of the multipliers with the multipliers of the equalities that belong to it: Aᵀy − Jᵀμ is what the
// minimum along it leaves, −(Q + δI)x, and nothing where the rows contradict each other.
bool Relaxation::contradicts(const Box& box) {
  signed_ = set_.ray();
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    if (set_.kind(row) != DualActiveSet::RowKind::fixed) signed_[row] = std::max(signed_[row], 0.0);
  }
  const double size = max_abs(signed_);
  if (!(size > 0.0) || !std::isfinite(size)) return false;
  signed_ /= size;
  Vector multipliers = Vector::Zero(problem_.equalities());
  for (int pass = 0; pass < tuning::tree_ray_passes; ++pass) {
    right_z_.setZero();
    add_transposed(problem_.rows, signed_, right_z_);
    add_transposed(problem_.A, -multipliers, right_z_);
    right_y_.setZero();
    if (!system_.solve(right_z_, right_y_)) return false;
    multipliers += right_y_;
    if (dual_bound_.contradicts(box, multipliers, signed_)) return true;
  }
  return false;
}

Relaxation::End Relaxation::solve(const Box& box, double cutoff, const Interrupt& interrupt) {
  double enough = cutoff - bound_;
  double paid = kInfinity;
  bool undecided = false;
  const double parent = bound_;
  for (int pass = 0; pass < tuning::tree_passes; ++pass) {
    const DualActiveSet::End end = set_.run(enough, tuning::tree_steps, interrupt);
    if (interrupt.requested()) return End::interrupted;
    if (end == DualActiveSet::End::infeasible) {
      if (contradicts(box)) return End::infeasible;
      set_.set_kind(set_.blocked(), DualActiveSet::RowKind::ignored);
      undecided = true;
    }
    undecided = undecided || end == DualActiveSet::End::stopped;
    if (!find_point()) return interrupt.requested() ? End::interrupted : End::undecided;
    bound_ = std::max({bound_, parent, evaluate_bound(box)});
    if (bound_ >= cutoff) return End::cutoff;
    if (end == DualActiveSet::End::optimal) {
      const bool small =
          std::isfinite(bound_) && dual_bound_.paid() <= tuning::tree_paid * (1.0 + std::abs(bound_));
      const bool no_better = std::isfinite(paid) && dual_bound_.paid() > 0.5 * paid;
      if (small || no_better) return undecided ? End::undecided : End::optimal;
      paid = dual_bound_.paid();
    }
    enough = kInfinity;
    if (!move_center()) return interrupt.requested() ? End::interrupted : End::undecided;
  }
  return End::undecided;
}

void Relaxation::save() {
  set_.save(saved_.set);
  saved_.z = z_;
  saved_.y = y_;
  saved_.z_center = z_center_;
  saved_.y_center = y_center_;
  saved_.bound = bound_;
}

void Relaxation::restore() {
  set_.restore(saved_.set);
  z_ = saved_.z;
  y_ = saved_.y;
  z_center_ = saved_.z_center;
  y_center_ = saved_.y_center;
  bound_ = saved_.bound;
}

}  // namespace marble
