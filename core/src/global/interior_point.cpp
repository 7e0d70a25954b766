#include "global/interior_point.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "model/tuning.h"
#include "path/keep_positive.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Returns how far along `change` all of these numbers stay positive.
double longest_step(const Vector& values, const Vector& change, const std::vector<std::uint8_t>& ignored) {
  double length = 1.0;
  for (Index i = 0; i < values.size(); ++i) {
    if (ignored[static_cast<std::size_t>(i)] == 0) keep_positive(values[i], change[i], length);
  }
  return length;
}

}  // namespace

InteriorPoint::InteriorPoint(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt)
    : problem_(problem),
      kkt_(std::move(kkt)),
      system_(problem, *kkt_),
      dual_bound_(problem),
      weights_(problem),
      fixed_(static_cast<std::size_t>(problem.layout.size())),
      z_(problem.variables()),
      y_(problem.equalities()),
      w_(problem.layout.size()),
      mu_(problem.layout.size()),
      equality_(problem.equalities()),
      rows_(problem.layout.size()),
      gradient_(problem.variables()),
      stationarity_(problem.variables()),
      dz_(problem.variables()),
      dy_(problem.equalities()),
      dw_(problem.layout.size()),
      dmu_(problem.layout.size()),
      complement_(problem.layout.size()) {}

bool InteriorPoint::prepare(Run& run) {
  attend(run.interrupt());
  kkt_->load(problem_);
  return true;
}

bool InteriorPoint::is_convex(Run& run) {
  if (!prepare(run)) return false;
  weights_.rho = weights_.delta = tuning::rounding;
  weights_.rows.all.setZero();
  ++run.factorizations;
  return run.timed(&Times::factorization_s, [this] { return kkt_->factor(weights_); });
}

ProximalSystem* InteriorPoint::proximal_system(Run& run) {
  ++run.factorizations;
  return system_.factor(tuning::exact_rho, tuning::tree_delta) ? &system_ : nullptr;
}

bool InteriorPoint::start(ConstVectorRef z) {
  z_ = z;
  std::ranges::fill(fixed_, std::uint8_t{0});
  bound_ = -kInfinity;
  return true;
}

bool InteriorPoint::start(const Center& /*center*/, const std::vector<Index>& /*held*/, double parent_bound) {
  std::ranges::fill(fixed_, std::uint8_t{0});
  bound_ = parent_bound;
  return true;
}

void InteriorPoint::restore(const State& state) {
  fixed_ = state.fixed;
  held_ = state.held;
  z_ = state.z;
  y_ = state.y;
  w_ = state.w;
  mu_ = state.mu;
  bound_ = state.bound;
}

// Starts at the least-squares solution of all rows, shifted until slacks and multipliers are positive
// (Mehrotra, "On the implementation of a primal-dual interior point method", 1992).
bool InteriorPoint::begin() {
  z_.setZero();
  y_.setZero();
  w_.setOnes();
  mu_.setOnes();
  for (Index row = 0; row < w_.size(); ++row) {
    if (is_fixed(row)) mu_[row] = 0.0;
  }
  evaluate();
  weights_.rho = tuning::exact_rho;
  weights_.delta = tuning::elastic_delta;
  weights_.rows.all.setOnes();
  for (Index row = 0; row < w_.size(); ++row) {
    if (is_fixed(row)) weights_.rows.all[row] = tuning::exact_rho;
  }
  ++factorizations_;
  if (!kkt_->factor(weights_)) return false;
  dz_ = -linear_;
  add_transposed(problem_.rows, -weights_.rows.all.cwiseProduct(problem_.offset), dz_);
  dy_ = -problem_.b;
  if (!kkt_->solve(dz_, dy_)) return false;
  z_ = dz_;
  y_ = dy_;
  multiply(problem_.rows, z_, rows_);
  rows_ += problem_.offset;
  double least = kInfinity, most = -kInfinity;
  for (Index row = 0; row < w_.size(); ++row) {
    if (is_fixed(row)) continue;
    least = std::min(least, rows_[row]);
    most = std::max(most, rows_[row]);
  }
  // The multipliers are −rows_ at this point.
  const double primal = std::max(0.0, -1.5 * least) + tuning::interior_inside;
  const double dual = std::max(0.0, 1.5 * most) + tuning::interior_inside;
  double product = 0.0, sum_w = 0.0, sum_mu = 0.0;
  for (Index row = 0; row < w_.size(); ++row) {
    w_[row] = rows_[row] + primal;
    mu_[row] = is_fixed(row) ? -weights_.rows.all[row] * rows_[row] : dual - rows_[row];
    if (is_fixed(row)) continue;
    product += w_[row] * mu_[row];
    sum_w += w_[row];
    sum_mu += mu_[row];
  }
  for (Index row = 0; row < w_.size(); ++row) {
    if (is_fixed(row)) continue;
    w_[row] += 0.5 * product / sum_mu;
    mu_[row] += 0.5 * product / sum_w;
  }
  return z_.allFinite() && y_.allFinite();
}

void InteriorPoint::evaluate() {
  multiply(problem_.Q, z_, gradient_);
  objective_ = 0.5 * z_.dot(gradient_) + linear_.dot(z_);
  gradient_ += linear_;
  stationarity_ = gradient_;
  add_transposed(problem_.A, y_, stationarity_);
  add_transposed(problem_.rows, -mu_, stationarity_);
  multiply(problem_.A, z_, equality_);
  equality_ += problem_.b;
  multiply(problem_.rows, z_, rows_);
  rows_ += problem_.offset;
}

double InteriorPoint::mean_product(const Vector& w, const Vector& mu) const {
  double sum = 0.0;
  Index count = 0;
  for (Index row = 0; row < w.size(); ++row) {
    if (is_fixed(row)) continue;
    sum += w[row] * mu[row];
    ++count;
  }
  return count == 0 ? 0.0 : sum / count;
}

double InteriorPoint::violation() const {
  double worst = max_abs(equality_);
  for (Index row = 0; row < w_.size(); ++row)
    worst = std::max(worst, is_fixed(row) ? std::abs(rows_[row]) : std::abs(rows_[row] - w_[row]));
  return worst;
}

// Evaluates the bound at this iterate; returns an end if that is sufficient.
std::optional<InteriorPoint::End> InteriorPoint::examine(const Box& box, double cutoff) {
  const double proved = dual_bound_.of_objective(box, z_, y_, mu_);
  note(z_, y_, mu_, proved);
  bound_ = std::max(bound_, proved);
  if (bound_ >= cutoff) return End::cutoff;
  const double size = 1.0 + std::abs(objective_);
  if (violation() <= tuning::tree_interior_gap && objective_ - bound_ <= tuning::tree_interior_gap * size)
    return End::optimal;
  const double largest = std::max(max_abs(mu_), max_abs(y_));
  if (largest > tuning::tree_interior_ray * size && contradicts(box, largest)) return End::infeasible;
  return std::nullopt;
}

// The multipliers grow along a ray for which Aᵀy − Jᵀμ is zero. Its residual r is removed with the current
// factor: if (Q + δI + JᵀWJ) dz + Aᵀdy = −r, then y + dy and μ − W J dz leave −(Q + δI) dz.
bool InteriorPoint::contradicts(const Box& box, double largest) {
  ray_y_ = y_ / largest;
  ray_mu_ = mu_ / largest;
  for (int pass = 0; pass < tuning::proof_passes; ++pass) {
    take_signs(
        ray_mu_, [this](Index row) { return is_fixed(row); }, signed_);
    if (dual_bound_.contradicts(box, ray_y_, signed_)) return true;
    dz_.setZero();
    add_transposed(problem_.A, -ray_y_, dz_);
    add_transposed(problem_.rows, signed_, dz_);
    dy_.setZero();
    if (!kkt_->solve(dz_, dy_) || !dz_.allFinite() || !dy_.allFinite()) return false;
    multiply(problem_.rows, dz_, dw_);
    ray_y_ += dy_;
    ray_mu_ = signed_ - weights_.rows.all.cwiseProduct(dw_);
  }
  return false;
}

// Computes the direction to w∘μ = κ with the current factor; if corrected, with the products dw∘dμ of the
// last direction.
bool InteriorPoint::direction(double kappa, bool corrected) {
  for (Index row = 0; row < w_.size(); ++row) {
    if (is_fixed(row)) {
      complement_[row] = -weights_.rows.all[row] * rows_[row];
      continue;
    }
    const double product = kappa - w_[row] * mu_[row] - (corrected ? dw_[row] * dmu_[row] : 0.0);
    complement_[row] = (product - mu_[row] * (rows_[row] - w_[row])) / w_[row];
  }
  dz_ = -stationarity_;
  add_transposed(problem_.rows, complement_, dz_);
  dy_ = -equality_;
  if (!kkt_->solve(dz_, dy_) || !dz_.allFinite() || !dy_.allFinite()) return false;
  multiply(problem_.rows, dz_, dw_);
  dmu_ = complement_ - weights_.rows.all.cwiseProduct(dw_);
  dw_ += rows_ - w_;
  return true;
}

// Returns false if there is no step.
bool InteriorPoint::step() {
  const double kappa = mean_product(w_, mu_);
  weights_.delta = std::clamp(tuning::elastic_delta * kappa, tuning::rounding, tuning::elastic_delta);
  for (Index row = 0; row < w_.size(); ++row)
    weights_.rows.all[row] = is_fixed(row) ? tuning::exact_rho : mu_[row] / w_[row];
  while (true) {
    ++factorizations_;
    if (kkt_->factor(weights_)) break;
    weights_.delta *= tuning::delta_raise;
    if (kkt_->interrupt().requested() || !(weights_.delta <= 1.0)) return false;  // NaN too
  }
  if (!direction(0.0, false)) return false;
  trial_w_ = w_ + longest_step(w_, dw_, fixed_) * dw_;
  trial_mu_ = mu_ + longest_step(mu_, dmu_, fixed_) * dmu_;
  const double ratio = kappa > 0.0 ? mean_product(trial_w_, trial_mu_) / kappa : 0.0;
  const double target = std::max(ratio * ratio * ratio * kappa, tuning::rounding);
  if (!direction(target, true)) return false;
  const double primal = tuning::interior_fraction * longest_step(w_, dw_, fixed_);
  const double dual = tuning::interior_fraction * longest_step(mu_, dmu_, fixed_);
  z_ += primal * dz_;
  y_ += dual * dy_;
  for (Index row = 0; row < w_.size(); ++row) {
    mu_[row] += dual * dmu_[row];
    if (!is_fixed(row)) w_[row] += primal * dw_[row];
  }
  return z_.allFinite() && y_.allFinite() && mu_.allFinite();
}

InteriorPoint::End InteriorPoint::solve(const Box& box, double cutoff, const Interrupt& interrupt) {
  kkt_->attend(interrupt);
  linear_ = problem_.g;
  forget_best();
  if (!begin()) return interrupt.requested() ? End::interrupted : End::undecided;
  std::optional<End> end;
  for (int iteration = 0; iteration < tuning::engine_budget && !end; ++iteration) {
    evaluate();
    end = examine(box, cutoff);
    // Small factors do not check the interrupt themselves.
    if (!end && (interrupt.requested() || !step()))
      end = interrupt.requested() ? End::interrupted : End::undecided;
  }
  finish();
  return end.value_or(End::undecided);
}

// At the optimum z' with a price on the slacks, S in sum, f(z') + S(z') ≤ f(z) + S(z): the prices make S(z)
// the rise. All prices differ, because otherwise an interior point method ends between slacks of which only
// the sum is determined.
std::vector<Index> InteriorPoint::zero_together(const std::vector<Index>& rows, double rise,
                                                const Interrupt& interrupt) {
  const auto weight = [](std::size_t k) { return 1.0 + std::fmod(0.618 * static_cast<double>(k), 1.0); };
  double sum = 0.0;
  for (std::size_t k = 0; k < rows.size(); ++k) sum += weight(k) * w_[rows[k]];
  if (!(sum > 0.0) || !std::isfinite(rise)) return {};
  const double price = rise / sum;
  const State solved{fixed_, held_, z_, y_, w_, mu_, bound_};
  linear_ = problem_.g;
  Vector priced = Vector::Zero(w_.size());
  for (std::size_t k = 0; k < rows.size(); ++k) priced[rows[k]] = price * weight(k);
  add_transposed(problem_.rows, priced, linear_);
  kkt_->attend(interrupt);
  std::vector<Index> zero;
  bool going = begin();
  for (int iteration = 0; iteration < tuning::engine_budget && going; ++iteration) {
    evaluate();
    // The slack of a zero row with such a multiplier is far smaller than it.
    if (violation() <= tuning::tree_interior_gap && mean_product(w_, mu_) <= 0.1 * price * price) {
      std::ranges::copy_if(rows, std::back_inserter(zero), [this](Index row) { return w_[row] < mu_[row]; });
      break;
    }
    going = !interrupt.requested() && step();
  }
  restore(solved);
  return zero;
}

// Rows whose multiplier exceeds their slack are active.
void InteriorPoint::finish() {
  held_.clear();
  for (Index row = 0; row < w_.size(); ++row) {
    if (!is_fixed(row) && w_[row] >= mu_[row] && w_[row] >= tuning::zero) continue;
    w_[row] = 0.0;
    held_.push_back(row);
  }
}

bool interior_point_pays(const ScaledProblem& problem, const Kkt& kkt) {
  const double rows = problem.layout.size();
  return rows >= tuning::tree_interior_rows && kkt.flops() < tuning::tree_interior_pays * rows * rows;
}

}  // namespace marble
