// Quadratic penalties of all constraints, with or without multiplier estimates.
//
// A point costs μ times its squared distance from the constraints. For a pair this is the distance from the
// two half lines {s = 0 ≤ t} and {t = 0 ≤ s}, so from the nearer one of two branches. f + μ·distance² is
// therefore the least of one convex function for each branch. Semismooth Newton steps minimize on one branch,
// then each pair takes the side that is nearer, until none changes.
#pragma once

#include "branch/branch_engines.h"
#include "research/reference_method.h"

namespace marble {

/// Minimizes one penalty, shifted by estimates: f + Σ ½ρ(c + α/ρ)² with ρ = 2μ.
class PiecewisePenalty {
 public:
  PiecewisePenalty(const ScaledProblem& problem, BranchEngines& branch)
      : problem_(problem), branch_(branch) {}

  /// Starts at z with all estimates 0.
  void start(ConstVectorRef z);
  /// Minimizes on the current branch from the current point. Returns false if no minimum was found.
  [[nodiscard]] bool minimize(Run& run, double rho);
  /// Chooses the nearer sides at that point, with c + α/ρ for c. Returns false if none has changed.
  [[nodiscard]] bool choose_sides(double rho);
  /// Returns the largest |λ − α|/ρ; for a constraint that holds at zero this is its violation.
  [[nodiscard]] double violation(double rho) const;
  /// Returns the violations of the point alone, in the user's units.
  [[nodiscard]] Violations user_violations() const { return violations(problem_, branch_.point.images); }
  /// α ← λ
  void take_estimates();
  [[nodiscard]] const Iterate& iterate() const { return branch_.point.x; }

 private:
  const ScaledProblem& problem_;
  BranchEngines& branch_;
};

/// The exterior penalty: μ grows tenfold until the violation, λ/2μ, is small (SUMT, Fiacco and McCormick
/// 1968).
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

/// The method of multipliers: if the violation has fallen to a quarter, the estimates become the multipliers;
/// otherwise μ grows tenfold (Hestenes 1969, Powell 1969; for pairs as in Jia, Kanzow, Mehlitz and Wachsmuth
/// 2023). One μ for all constraints.
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
