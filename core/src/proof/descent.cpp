#include "proof/descent.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/tuning.h"
#include "path/noise.h"

namespace marble {

Descent::Descent(const ScaledProblem& problem, Kkt& kkt, BranchPoint& point)
    : problem_(problem),
      kkt_(kkt),
      point_(point),
      x_(problem),
      set_(problem),
      images_(problem),
      rates_(problem),
      direction_(problem.variables()),
      image_(problem.variables()),
      nothing_(Vector::Zero(problem.equalities())),
      reporter_(problem) {}

Descent::End Descent::run(Run& run, const Iterate& x, const WorkingSet& set, ConstVectorRef first,
                          int budget) {
  const Run::Searching searching(run);
  x_.all = x.all;
  set_ = set;
  short_steps_ = 0;
  const int last = run.factorizations + budget;
  bool curved = began_at_saddle_ = first.size() > 0;
  if (curved) direction_ = first;
  bool moved = false;
  images_.evaluate(problem_, x_);
  while (true) {
    if (curved) {
      if (moved || !began_at_saddle_) orient();  // the sign of the first one is given by the cone
      const Block block = blocking(std::numeric_limits<double>::infinity());
      began_at_saddle_ = began_at_saddle_ || !moved;
      moved = true;
      if (block.flag == nullptr) return End::unbounded;
      move(block);
    }
    if (run.factorizations >= last || run.interrupted()) return End::stopped;
    ++run.iterations;
    report(run);
    set_.clear_others(x_.lambda());
    point_.restore(x_, set_);
    curved = !point_.factor(run, tuning::exact_rho, tuning::exact_delta);
    if (curved) {
      if (run.interrupted()) return End::stopped;
      if (find_negative_curvature(run, last)) continue;
      // Flat: the penalty ρ alone removes |Q|²/ρ from the curvature, about as much as δ adds.
      curved = !point_.factor(run, tuning::exact_rho, tuning::elastic_delta);
      if (curved) return End::stopped;
    }
    moved = true;
    if (!point_.sharpen()) {  // the gradient has a component along which Q is flat
      direction_ = -images_.gradient;
      nothing_.setZero();
      if (!kkt_.solve(direction_, nothing_) || !point_.project(direction_)) return End::stopped;
      const Block block = blocking(1.0);
      if (block.flag == nullptr) return End::unbounded;
      move(block);
      continue;
    }
    direction_ = point_.x.z() - x_.z();
    const Block block = blocking(1.0);
    if (block.flag != nullptr) {
      move(block);
      continue;
    }
    x_.all = point_.x.all;
    images_.evaluate(problem_, x_);
    if (!release_worst()) return End::minimum;
  }
}

void Descent::report(Run& run) {
  reporter_.report(run, x_.z(), images_.objective, violations(problem_, images_),
                   {.rho = tuning::exact_rho, .step_length = 1.0});
}

// Moves to the blocking row, which is held from then on.
void Descent::move(const Block& block) {
  x_.z() += block.length * direction_;
  images_.evaluate(problem_, x_);
  *block.flag = 1;
  short_steps_ =
      block.length * max_abs(direction_) <= tuning::rounding * (1.0 + max_abs(x_.z())) ? short_steps_ + 1 : 0;
}

// Orients the direction downhill, or, if it is level, to the side with the longer feasible step.
void Descent::orient() {
  const double slope = images_.gradient.dot(direction_);
  if (slope > 0.0) direction_ = -direction_;
  if (std::abs(slope) > tuning::rounding * (1.0 + images_.gradient.norm()) * direction_.norm()) return;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Block ahead = blocking(kInfinity);
  if (ahead.flag == nullptr) return;
  direction_ = -direction_;
  const Block back = blocking(kInfinity);
  if (back.flag != nullptr && back.length <= ahead.length) direction_ = -direction_;
}

// Returns the first free row that reaches zero along the direction within `longest`.
Descent::Block Descent::blocking(double longest) {
  rates_.evaluate_rows(problem_, direction_);
  Block first{nullptr, longest};
  double fastest = 0.0;
  const double flat = tuning::roundoff * max_abs(direction_);
  set_.for_each_free_row([&](Index row) {
    std::uint8_t& flag = set_.held[row];
    const double rate = rates_.rows.all[row];
    if (flag != 0 || !(rate < -flat)) return;
    const double length = std::max(images_.rows.all[row], 0.0) / -rate;
    if (length > first.length || (length == first.length && -rate <= fastest)) return;
    first = {&flag, length};
    fastest = -rate;
  });
  return first;
}

// Releases the held free row whose multiplier has the wrong sign by the largest amount.
bool Descent::release_worst() {
  std::uint8_t* worst = nullptr;
  double most = tuning::exactness * (1.0 + max_abs(x_.all));
  set_.for_each_free_row([&](Index row) {
    std::uint8_t& flag = set_.held[row];
    const double lambda = x_.lambda()[row];
    if (flag == 0 || !(lambda > most) || (worst != nullptr && short_steps_ > tuning::patience)) return;
    worst = &flag;
    most = lambda;
  });
  if (worst == nullptr) return false;
  *worst = 0;
  return true;
}

// Inverse iteration with Q + δI + ρJᵀJ, which δ only just makes convex: for a curvature between −δ and −δ/10
// each step gains a factor of at least 10/9.
bool Descent::find_negative_curvature(Run& run, int last) {
  const auto convex_at = [&](double delta) { return point_.factor(run, tuning::exact_rho, delta); };
  double low = tuning::exact_delta;
  double high = delta_;
  while (!convex_at(high)) {
    if (run.factorizations >= last || high > tuning::runaway) return false;
    low = high;
    high *= tuning::delta_raise;
  }
  while (!iterate_inversely()) {
    double middle = 0.0;
    do {
      if (high <= tuning::delta_raise * low || run.factorizations >= last || run.interrupted()) return false;
      middle = std::sqrt(low * high);
      if (convex_at(middle)) break;
      low = middle;
    } while (true);
    high = middle;
  }
  delta_ = high;
  return true;
}

bool Descent::iterate_inversely() {
  for (Index j = 0; j < direction_.size(); ++j) direction_[j] = signed_noise(0, j);
  double curvature = std::numeric_limits<double>::infinity();
  for (int i = 0; i < tuning::engine_budget; ++i) {
    nothing_.setZero();
    if (!kkt_.solve(direction_, nothing_) || !point_.project(direction_)) return false;
    const double size = direction_.norm();
    if (!(size > 0.0) || !std::isfinite(size)) return false;
    direction_ /= size;
    multiply(problem_.Q, direction_, image_);
    const double now = direction_.dot(image_);
    const bool settled = now < -tuning::zero && std::abs(now - curvature) <= tuning::alike * std::abs(now);
    curvature = now;
    if (settled) break;
  }
  if (!(curvature < -tuning::zero)) return false;
  return point_.project(direction_);
}

}  // namespace marble
