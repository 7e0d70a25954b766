// How κ, ρ and δ move: the outer loop of Algorithm 1, and its faster variant.
#pragma once

#include "data/residual.h"
#include "marble/options.h"
#include "tuning.h"

namespace marble {

/// δ of the inertia correction: starts small, remembers the last success, ×8 up, ÷3 down (IPOPT's habit); or
/// as Algorithm 1 prints it: max(10², 10 δ) from 0, each time.
class Regularization {
 public:
  explicit Regularization(const Options& options);
  [[nodiscard]] double current() const { return current_; }
  /// For the first try of an iteration.
  void begin() { current_ = base_; }
  /// After wrong inertia or a failed line search. False once δ is beyond any use.
  [[nodiscard]] bool raise();
  /// After an accepted step.
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

  /// κ and ρ of the first subproblem.
  void begin(Subproblem& sub) const;
  /// Whether ‖r‖∞ is small enough for this subproblem.
  [[nodiscard]] bool inner_converged(const Subproblem& sub, double residual_norm) const;
  /// Algorithm 1, lines 23–28: ρ first, then κ and the multiplier estimates.
  void advance(Subproblem& sub, const Iterate& x) const;
  /// The fast path's second thought: κ was lowered too far to be followed from where it was `kappa_before`.
  /// Goes half of the way (in log κ). False once the way left is too short to matter.
  [[nodiscard]] bool retreat(Subproblem& sub, double kappa_before) const;
  /// No more to lower or raise: only the estimates can still change.
  [[nodiscard]] bool exhausted(const Subproblem& sub) const;

 private:
  const Options& options_;
};

}  // namespace marble
