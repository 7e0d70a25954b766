// What multipliers of the rows prove by themselves: the corresponding z and y are found with K's factor.
//
// Multipliers that were found for other numbers of the same pattern therefore still prove a bound for the
// current ones, whatever has changed; if z is free along a flat direction, they must first be adapted.
// (Marcucci and Tedrake, "Warm start of mixed-integer programs for model predictive control of hybrid
// systems", 2020.)
#pragma once

#include <limits>

#include "global/dual_bound.h"
#include "global/gram.h"
#include "model/tuning.h"
#include "path/proof_record.h"

namespace marble {

class RowProof {
 public:
  RowProof(const ScaledProblem& problem, ProximalSystem& system);

  /// Returns a bound of the objective, starting from z; stops once it reaches `enough`. Multipliers must have
  /// the right signs.
  [[nodiscard]] double bound(const Box& box, ConstVectorRef z, const Vector& multipliers, double enough);
  /// Changes the multipliers to those of the optimum that holds the same rows at zero, without rows of a
  /// wrong sign, and returns their bound. Destroys K's factor.
  template <class IsFixed>
  [[nodiscard]] double adapt(const Box& box, ConstVectorRef z, const IsFixed& is_fixed, Vector& multipliers,
                             double enough) {
    double best = -std::numeric_limits<double>::infinity();
    for (int pass = 0; pass < tuning::proof_passes; ++pass) {
      if (!hold(z, multipliers)) break;
      take_signs(held_multipliers_, is_fixed, multipliers);
      best = std::max(best, dual_bound_.of_objective(box, z_, y_, multipliers));
      if (best >= enough || multipliers == held_multipliers_) break;
    }
    return best;
  }
  [[nodiscard]] std::int64_t factorizations() const { return factorizations_; }
  /// True if the multipliers contradict the rows.
  [[nodiscard]] bool contradicts(const Box& box, const Vector& multipliers);
  /// After contradicts() returned true: the proof.
  [[nodiscard]] LeafMultipliers contradiction() const { return {true, {}, y_, ray_}; }

 private:
  [[nodiscard]] bool hold(ConstVectorRef z, const Vector& multipliers);

  const ScaledProblem& problem_;
  ProximalSystem& system_;
  DualBound dual_bound_;
  RowWeights weights_;
  Vector z_, y_, right_z_, right_y_, ray_, held_multipliers_, slacks_;
  std::int64_t factorizations_ = 0;
};

}  // namespace marble
