// The schedule of κ, ρ and δ: the outer loop of Algorithm 1, and its faster variant.
#pragma once

#include "marble/options.h"
#include "model/residual.h"
#include "model/tuning.h"

namespace marble {

/// δ of the inertia correction: starts small, remembers the last success, ×8 up, ÷3 down (as in IPOPT); or as
/// printed in Algorithm 1: max(10², 10 δ) from 0, each time.
class Regularization {
 public:
  explicit Regularization(const Options& options);
  [[nodiscard]] double current() const { return current_; }
  /// Call this before the first attempt of an iteration.
  void begin() { current_ = base_; }
  /// Call this after wrong inertia or a failed line search. Returns false once δ is too large to be useful.
  [[nodiscard]] bool raise();
  /// Call this after an accepted step.
  void accept() { last_ = current_ > base_ ? current_ : last_ / tuning::delta_lower; }

 private:
  double base_, first_, factor_;
  bool remembers_;
  double current_ = 0.0, last_ = 0.0;
};

/// Decides when an inner loop ends and what the next subproblem is.
class Schedule {
 public:
  explicit Schedule(const Options& options) : options_(options) {}

  /// Sets κ and ρ of the first subproblem.
  void begin(Subproblem& sub) const;
  /// True if ‖r‖∞ is small enough for this subproblem.
  [[nodiscard]] bool inner_converged(const Subproblem& sub, double residual_norm) const;
  /// Algorithm 1, lines 23–28: ρ first, then κ and the multiplier estimates.
  void advance(Subproblem& sub, const Iterate& x) const;
  /// For the fast path, if κ was lowered too far from `kappa_before` to be followed: takes half of the way
  /// (in log κ). Returns false once the remaining way is too short to matter.
  [[nodiscard]] bool retreat(Subproblem& sub, double kappa_before) const;
  /// True if κ and ρ are at their limits: only the estimates can still change.
  [[nodiscard]] bool exhausted(const Subproblem& sub) const;

 private:
  const Options& options_;
};

}  // namespace marble
