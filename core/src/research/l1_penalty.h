// The exact penalty of the pairs, μ Σ min(s, t), with all other constraints unchanged.
//
// The penalty is concave: the linear function of the chosen side of each pair is nowhere below it. Let a QP
// minimize f + μ Σ (chosen side). If another side is smaller at its minimum, f + μ Σ min(s, t) is lower
// there, and the next QP uses these sides. If the sides stay, the point is a local minimum of the current
// piece. Then μ grows tenfold until all chosen sides are 0, which they are once μ exceeds the multipliers.
#pragma once

#include <cstdint>
#include <vector>

#include "research/reference_method.h"
#include "research/relaxed_qp.h"

namespace marble {

class L1Penalty final : public ReferenceMethod {
 public:
  L1Penalty(const ScaledProblem& problem, Kkt& kkt);

  void start(ConstVectorRef initial_z) override;
  [[nodiscard]] State step(Run& run) override;
  [[nodiscard]] const Iterate& iterate() const override { return x_; }
  [[nodiscard]] double penalty() const override { return penalty_; }

 private:
  [[nodiscard]] bool choose_sides(bool first);

  const ScaledProblem& problem_;
  RelaxedQp qp_;
  Iterate x_;
  std::vector<std::uint8_t> s_chosen_;
  Vector rows_, costs_;
  double penalty_ = 0.0;
};

}  // namespace marble
