// ALADIN-β (Wang, Wu, Yang, Chu, Rikos and Du: "ALADIN-β: A Distributed Optimization Algorithm for Solving
// MPCC Problems"): splits the ℓ₁ penalty-barrier into three problems that are solved separately and
// coordinated by a QP.
//
// With rows x = Jz + c, whose parts s and t are the pairs' sides, and s∘t = q − m, λ enforces x = β and
// (q, m) = γ:
//   α = (z, q, m):  min f + ½P|(q, m) − γ⁻|² + λᵀ(x, q, m) + ½Σ|(x, q, m) − (x, q, m)⁻|²
//                   over Az + b = 0 and s∘t − q + m = 0 | κ,
//   β:              min −μ Σ ln(r + β) − λᵀβ + ½Σ|β − β⁻|²,  and γ likewise with ρ Σ γ: softpluses (4).
// The coordination QP (17) of their gradients and curvatures gives the next α and λ; z carries x in both.
//
// Not taken from the printed text: x ≤ 0 in (1c), which contradicts x ⪰ 0 in (18), and (18)'s r − β; the sum
// and the signs in (16c), where p and n have a curvature each; (18)'s single scalar product, with which no
// tested setting gets below 1e-8. The text does not give r, Σ, P and M, and has no globalization. Here a
// merit test ends the method if it does not converge, and the ℓ₁ penalty-barrier itself continues from the
// best point so far.
#pragma once

#include <vector>

#include "research/l1_barrier.h"
#include "research/split_step.h"

namespace marble {

class AladinBeta final : public ReferenceMethod {
 public:
  AladinBeta(const ScaledProblem& problem, Kkt& kkt, const Options& options);

  void start(ConstVectorRef initial_z) override;
  [[nodiscard]] State step(Run& run) override;
  [[nodiscard]] const Iterate& iterate() const override { return fell_back() ? fallback_.iterate() : x_; }
  [[nodiscard]] double penalty() const override { return fell_back() ? fallback_.penalty() : rho_; }
  [[nodiscard]] double relaxation() const override { return fell_back() ? fallback_.relaxation() : mu_; }
  [[nodiscard]] std::string remark() const override;

  /// Returns the largest entry of (x, q, m) − (β, γ) after the three separate solves.
  [[nodiscard]] double coupling_gap() const { return coupling_gap_; }

  /// The copy of one number x with its barrier, min −μ ln(r + β) + cost·β − λβ + ½Σ(β − x)².
  struct Copy {
    Copy(double x, double lambda, double cost, double mu, double r);
    double value;      ///< β
    double slope;      ///< derivative of barrier and cost there
    double curvature;  ///< second derivative of the barrier, limited so that rounding does not hide λ
  };

 private:
  [[nodiscard]] bool fell_back() const { return why_back_ != nullptr; }
  [[nodiscard]] const char* iterate_once(Run& run);
  [[nodiscard]] bool solve_local(Run& run);
  [[nodiscard]] bool coordinate(Run& run);
  [[nodiscard]] double merit() const;
  [[nodiscard]] bool converged() const;

  const ScaledProblem& problem_;
  const Options& options_;
  SplitStep qp_;
  L1Barrier fallback_;
  Iterate x_, local_;  // z and y of α⁻ and of α̂; x_ also has the rows' multipliers, for the final check
  Images images_, local_images_;              // theirs, without those multipliers
  Vector alpha_, local_alpha_;                // (x, q, m), as for all following vectors
  Vector lambda_, copy_, slope_, curvature_;  // λ; (β̂, γ̂) with their gradients and curvatures
  Vector kappa_;                              // n_c
  Vector best_z_;
  std::vector<double> merits_;  // of the last iterations
  double best_merit_ = 0.0, mu_ = 0.0, rho_ = 0.0, coupling_gap_ = 0.0, stationarity_ = 0.0;
  int iterations_ = 0;
  const char* why_back_ = nullptr;
};

}  // namespace marble
