// The ℓ₁ penalty-barrier: all complementarities of a problem as an exact penalty, all its bounds as a
// barrier. Thierry and Biegler, IFAC-PapersOnLine 53 (2020).
//
// With slacks x of all rows [C; L; R], whose parts s and t are the pairs' sides,
//   min f(z) − μ Σ ln x + ρ Σ (p + n) − μ Σ (ln p + ln n)
//   over  Az + b = 0,  Jz + c = x,  s∘t − p + n = 0.
// Since p and n are free positive variables, the gradients of the last rows are never dependent. Once
// ρ ≥ ‖(κ*, ν*)‖∞, both are zero at its minima. The Newton steps solve
//   Qz + g + Aᵀy − Jᵀ(ν − κ∘(0; t; s)) = 0,  ν∘x = μ,  (ρ − κ)∘p = μ,  (ρ + κ)∘n = μ  and these rows,
// reduced to z and y: dp and dn become a weight W of t ds + s dt.
//
// Without p and n, this is an interior point method applied to s∘t = 0 itself. The bounds are then relaxed,
// as IPOPT relaxes them, because otherwise no point would be in the interior.
#pragma once

#include "kkt/kkt.h"
#include "model/residual.h"
#include "research/reference_method.h"

namespace marble {

class L1Barrier final : public ReferenceMethod {
 public:
  /// When μ falls and ρ rises.
  enum class Schedule {
    every_problem,  ///< once the residual is below 10 μ, as in Thierry and Biegler
    every_step,     ///< after each Newton step
    no_penalty,     ///< like the first, without p and n
  };
  L1Barrier(const ScaledProblem& problem, Kkt& kkt, const Options& options, Schedule schedule);

  void start(ConstVectorRef initial_z) override;
  [[nodiscard]] State step(Run& run) override;
  [[nodiscard]] const Iterate& iterate() const override { return x_; }
  [[nodiscard]] double penalty() const override { return elastic() ? rho_ : 0.0; }
  [[nodiscard]] double relaxation() const override { return mu_; }

  /// p and n at the values of the barrier alone for a product s·t = `product` ≥ 0.
  struct Elastic {
    Elastic(double product, double rho, double mu);
    double p, n;
  };

 private:
  [[nodiscard]] bool elastic() const { return schedule_ != Schedule::no_penalty; }
  void evaluate();
  void weigh();
  [[nodiscard]] bool direction();
  void move();
  void next_problem();
  [[nodiscard]] double s(Index pair) const { return slack_.s()[pair] - relaxed_by_; }
  [[nodiscard]] double t(Index pair) const { return slack_.t()[pair] - relaxed_by_; }

  const ScaledProblem& problem_;
  Kkt& kkt_;
  const Options& options_;
  const Schedule schedule_;
  const double relaxed_by_;  // distance of the bounds beyond zero
  const double rho_most_;
  RowWeights weights_;
  Iterate x_, d_;
  Images images_;
  RowVector slack_, slack_step_, nu_, nu_step_, gap_, force_, rhs_;  // x + the relaxation; Jz + c − x
  Vector p_, n_, p_step_, n_step_;                                   // by pair, as all following vectors
  Vector pi_p_, pi_n_;                                               // ρ − κ and ρ + κ, as iterated
  Vector kappa_, kappa_step_;                                        // multipliers of the products
  Vector product_residual_, pull_, w_;  // s∘t − p + n; its part of the step by the weight W
  Vector gradient_;
  double mu_ = 0.0, rho_ = 0.0, residual_ = 0.0, delta_ = 0.0;
  int steps_here_ = 0;
};

}  // namespace marble
