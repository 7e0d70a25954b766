#include "global/relaxation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

Relaxation::Relaxation(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt, Gram& gram)
    : problem_(problem),
      kkt_(std::move(kkt)),
      system_(problem, *kkt_),
      row_proof_(problem, system_),
      gram_(problem, gram, system_),
      set_(gram_),
      dual_bound_(problem),
      signed_(problem.layout.size()),
      image_(problem.variables()),
      rates_(problem.layout.size()) {}

bool Relaxation::prepare(Run& run) {
  attend(run.interrupt());
  kkt_->load(problem_);
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

bool Relaxation::release(const std::vector<Index>& rows) {
  const double before = bound_ - set_.objective();
  bound_ = -kInfinity;
  for (const Index row : rows) set_.set_kind(row, DualActiveSet::RowKind::inequality);
  const bool settled = set_.settle();
  estimate_ = before + set_.objective();
  return settled;
}

// Computes the minimum around the center for the current multipliers.
bool Relaxation::find_point() {
  z_ = z_center_;
  y_ = y_center_;
  return system_.minimize(set_.multipliers(), z_, y_);
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

void Relaxation::take_signs_of(const Vector& multipliers) {
  const auto is_fixed = [this](Index row) { return set_.kind(row) == DualActiveSet::RowKind::fixed; };
  take_signs(multipliers, is_fixed, signed_);
}

double Relaxation::evaluate_bound(const Box& box) {
  take_signs_of(set_.multipliers());
  return dual_bound_.of_objective(box, z_, y_, signed_);
}

bool Relaxation::contradicts(const Box& box) {
  take_signs_of(set_.ray());
  return row_proof_.contradicts(box, signed_);
}

// Includes the dense matrices: that of the held rows, and two factors of it with spare capacity.
double Relaxation::bytes() {
  const double held = std::min<double>(problem_.variables(), problem_.layout.size());
  return kkt_->bytes() + 4.0 * held * held * sizeof(double);
}

// Along flat or nearly flat directions a proximal step is short. It is therefore extended to the minimum
// there, or to the first row that blocks. A step that has just reached a held row, on which the last center
// was not, is not extended: it would leave that row again.
void Relaxation::lengthen_step() {
  step_ = z_ - z_center_;
  multiply(problem_.Q, step_, image_);
  const double curvature = step_.dot(image_);
  double length = curvature > 0.0 ? tuning::tree_delta * step_.squaredNorm() / curvature : kInfinity;
  multiply(problem_.rows, step_, rates_);
  const double still = tuning::exactness * max_abs(step_);
  for (Index row = 0; row < rates_.size(); ++row) {
    if (set_.is_held(row) && std::abs(rates_[row]) > still) return;
    if (!set_.is_held(row) && rates_[row] < 0.0)
      length = std::min(length, std::max(0.0, set_.slacks()[row]) / -rates_[row]);
  }
  if (std::isfinite(length) && length > 1.0) z_ += length * step_;
}

Relaxation::End Relaxation::solve(const Box& box, double cutoff, const Interrupt& interrupt) {
  forget_best();
  double enough = cutoff - std::max(bound_, std::exchange(estimate_, -kInfinity));
  double paid = kInfinity;
  bool undecided = false;
  const double parent = bound_;
  for (int pass = 0; pass < tuning::tree_passes; ++pass) {
    ++points_;
    const DualActiveSet::End end = set_.run(enough, tuning::tree_steps, interrupt);
    if (interrupt.requested()) return End::interrupted;
    if (end == DualActiveSet::End::infeasible) {
      if (contradicts(box)) return End::infeasible;
      set_.set_kind(set_.blocked(), DualActiveSet::RowKind::ignored);
      undecided = true;
    }
    undecided = undecided || end == DualActiveSet::End::stopped;
    if (!find_point()) return interrupt.requested() ? End::interrupted : End::undecided;
    const double proved = evaluate_bound(box);
    note(z_, y_, signed_, proved);
    bound_ = std::max({bound_, parent, proved});
    if (bound_ >= cutoff) return End::cutoff;
    if (end == DualActiveSet::End::optimal) {
      const bool small =
          std::isfinite(bound_) && dual_bound_.paid() <= tuning::exactness * (1.0 + std::abs(bound_));
      const bool no_better = std::isfinite(paid) && dual_bound_.paid() > 0.5 * paid;
      if (small || no_better) return undecided ? End::undecided : End::optimal;
      paid = dual_bound_.paid();
    }
    enough = kInfinity;
    if (end == DualActiveSet::End::optimal) lengthen_step();
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
  forget_best();
  set_.restore(saved_.set);
  z_ = saved_.z;
  y_ = saved_.y;
  z_center_ = saved_.z_center;
  y_center_ = saved_.y_center;
  bound_ = saved_.bound;
}

}  // namespace marble
