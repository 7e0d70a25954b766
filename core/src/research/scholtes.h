// Complementarity relaxed to s∘t ≤ τ with τ → 0 (Scholtes, SIAM J. Optim. 11, 2001), by an interior point
// method.
//
// With slacks w of all rows [C; L; R], u = τ − s∘t and multipliers ν, ξ > 0, the Newton steps solve
//   Qz + g + Aᵀy − Jᵀ(ν − ξ∘(0; t; s)) = 0,  Az + b = 0,  Jz + c = w,  s∘t + u = τ,  w∘ν = κ,  u∘ξ = κ,
// reduced to z and y. A pair's two rows get the 2 × 2 weight
//   diag(ν_s/s, ν_t/t) + ξ [0 1; 1 0] + ξ/u (t, s)ᵀ(t, s),
// rotated to its eigenvectors. κ is a tenth of τ; both fall once the residual is below a tenth of κ.
#pragma once

#include "kkt/kkt.h"
#include "model/residual.h"
#include "research/reference_method.h"

namespace marble {

class ScholtesRelaxation final : public ReferenceMethod {
 public:
  ScholtesRelaxation(const ScaledProblem& problem, Kkt& kkt, const Options& options);

  void start(ConstVectorRef initial_z) override;
  [[nodiscard]] State step(Run& run) override;
  [[nodiscard]] const Iterate& iterate() const override { return x_; }
  [[nodiscard]] double penalty() const override { return 0.0; }
  [[nodiscard]] double relaxation() const override { return tau_; }

 private:
  void evaluate();
  void weigh();
  [[nodiscard]] bool direction();
  void move();

  const ScaledProblem& problem_;
  Kkt& kkt_;
  const Options& options_;
  RowWeights weights_;
  Iterate x_, d_;
  Images images_;
  RowVector slack_, slack_step_, nu_, nu_step_, force_, rhs_;  // w, dw, ν, dν, ν − ξ∘(0; t; s), rows' part
  Vector u_, u_step_, xi_, xi_step_, product_residual_;        // by pair
  Vector gradient_;
  double tau_ = 0.0, kappa_ = 0.0, residual_ = 0.0, delta_ = 0.0, step_length_ = 0.0;
  int short_steps_ = 0, steps_here_ = 0;
};

}  // namespace marble
