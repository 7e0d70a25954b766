// The pairs' products as a linearized penalty: LCQPow's iteration (Hall, Nurkanović, Messerer and Diehl,
// 2022).
//
// With φ(z) = s(z)ᵀt(z), a QP minimizes f + π∇φ(z_j)ᵀz over all constraints except complementarity, which
// gives a step d. The step length is α = −∇(f + πφ)ᵀd / dᵀ(Q + π∇²φ)d, at most 1, and 1 along negative
// curvature. If z is stationary and φ is not 0, π doubles.
#pragma once

#include "research/reference_method.h"
#include "research/relaxed_qp.h"

namespace marble {

class PenaltyScp final : public ReferenceMethod {
 public:
  PenaltyScp(const ScaledProblem& problem, Kkt& kkt);

  void start(ConstVectorRef initial_z) override;
  [[nodiscard]] State step(Run& run) override;
  [[nodiscard]] const Iterate& iterate() const override { return x_; }
  [[nodiscard]] double penalty() const override { return penalty_; }

  /// Returns the length of the last step, relative to the QP's step.
  [[nodiscard]] double step_length() const { return step_length_; }

 private:
  [[nodiscard]] double length(double slope);
  void evaluate_rows();

  const ScaledProblem& problem_;
  RelaxedQp qp_;
  Iterate x_;
  Vector step_, product_, rows_, rates_, costs_;
  double penalty_ = 0.0, step_length_ = 0.0;
};

}  // namespace marble
