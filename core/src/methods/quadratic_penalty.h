// Quadratic penalties of everything that constrains, with estimates of multipliers or without.
//
// A point costs μ times its squared distance from the constraints: of a pair that from the two half lines
// {s = 0 ≤ t} and {t = 0 ≤ s}, so of one of two branches, the nearer one. So f + μ·distance² is the least of
// a convex function for each branch: the minimum on one is found by semismooth Newton steps, each pair then
// takes the side that is nearer there, and so on until none changes.
#pragma once

#include "branch/branch_engines.h"
#include "methods/reference_method.h"

namespace marble {

/// One penalty's minimum, shifted by estimates: f + Σ ½ρ(c + α/ρ)² with ρ = 2μ.
class PiecewisePenalty {
 public:
  PiecewisePenalty(const ScaledProblem& problem, BranchEngines& branch)
      : problem_(problem), branch_(branch) {}

  /// At z, all estimates 0.
  void start(ConstVectorRef z);
  /// To the minimum of the branch at hand, from where it is. False if that was not found.
  [[nodiscard]] bool minimize(Run& run, double rho);
  /// The sides that are nearer there, with c + α/ρ for c. False if none has changed.
  [[nodiscard]] bool choose_sides(double rho);
  /// By how much (λ − α)/ρ is away from 0: of what holds at zero the violation.
  [[nodiscard]] double violation(double rho) const;
  /// Of the point alone, in the user's units.
  [[nodiscard]] Violations user_violations() const { return violations(problem_, branch_.point.images); }
  /// α ← λ
  void take_estimates();
  [[nodiscard]] const Iterate& iterate() const { return branch_.point.x; }

 private:
  const ScaledProblem& problem_;
  BranchEngines& branch_;
};

/// The exterior penalty: μ grows tenfold until the violation, which is λ/2μ, is small (SUMT, Fiacco and
/// McCormick 1968).
class ExteriorPenalty final : public ReferenceMethod {
 public:
  ExteriorPenalty(const ScaledProblem& problem, const Options& options, BranchEngines& branch)
      : options_(options), piece_(problem, branch) {}

  void start(ConstVectorRef initial_z) override;
  [[nodiscard]] State step(Run& run) override;
  [[nodiscard]] const Iterate& iterate() const override { return piece_.iterate(); }
  [[nodiscard]] double penalty() const override { return penalty_; }

 private:
  const Options& options_;
  PiecewisePenalty piece_;
  double penalty_ = 0.0;  // μ
};

/// The method of multipliers: where the violation has fallen to a quarter the estimates become the
/// multipliers, else μ grows tenfold (Hestenes 1969, Powell 1969; of pairs as Jia, Kanzow, Mehlitz and
/// Wachsmuth 2023). One μ for all constraints.
class AugmentedLagrangian final : public ReferenceMethod {
 public:
  AugmentedLagrangian(const ScaledProblem& problem, BranchEngines& branch) : piece_(problem, branch) {}

  void start(ConstVectorRef initial_z) override;
  [[nodiscard]] State step(Run& run) override;
  [[nodiscard]] const Iterate& iterate() const override { return piece_.iterate(); }
  [[nodiscard]] double penalty() const override { return penalty_; }

 private:
  PiecewisePenalty piece_;
  double penalty_ = 0.0, violation_ = 0.0;
};

}  // namespace marble
