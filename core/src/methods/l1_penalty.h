// The exact penalty of the pairs, μ Σ min(s, t), with all other constraints as they are.
//
// It is concave: on the side that is chosen of each pair it is linear and nowhere below. So the QP's minimum
// of f + μ Σ (the side chosen) has a lower f + μ Σ min(s, t) wherever another side is the smaller one there;
// these sides are the next QP's. Where they stay, the point is a local minimum of the piece, and μ grows
// tenfold until all of them are 0, which they are once μ is above the multipliers.
#pragma once

#include <cstdint>
#include <vector>

#include "methods/reference_method.h"
#include "methods/relaxed_qp.h"

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
