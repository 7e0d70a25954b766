// Proofs that there is no solution, evaluated with their rounding errors.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "model/residual.h"

namespace marble {

/// Multipliers (y, ν, ξ, η) of the user's rows, stacked, that contradict the relaxation without
/// complementarity (Farkas): ν, ξ, η ≥ 0, bᵀy − dᵀν − lᵀξ − rᵀη = 1 and r = Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0 to
/// rounding. A feasible z has 1 + rᵀz ≤ 0, so that the rounding error left in r matters only far away.
struct FarkasProof {
  std::vector<double> multipliers;
  double radius = 0.0;  ///< no z with |z|∞ ≤ radius is feasible: 1 / ‖r‖₁, user units, rounding included
};

/// Returns the iterate's normalized multipliers if they are such a proof: every entry of r is at most the
/// rounding error of the products in its sum, and the gap is larger than its own. Nothing else counts as a
/// proof: for z = −10²⁰⁰, in which nothing cancels, no multiplier is one. Rows of `zero` are sides that a
/// branch holds at zero; their multipliers may have any sign.
[[nodiscard]] std::optional<FarkasProof> infeasibility_certificate(const ScaledProblem& p, const Iterate& x,
                                                                   std::span<const std::uint8_t> zero = {});

/// Returns the direction d (scaled), unscaled with largest entry 1, if the objective falls along it without
/// bound from every feasible point of a branch in which d stays: Ad = 0, Cd ≥ 0, min(Ld, Rd) = 0 to rounding
/// of the products, and dᵀQd < 0, or Qd = 0 to rounding and gᵀd < 0, by more than rounding.
[[nodiscard]] std::optional<std::vector<double>> unbounded_direction(const ScaledProblem& p,
                                                                     ConstVectorRef d);

/// True if the iterate's multipliers, or its z, are close to a proof (to 10⁻⁶), so that it is worth looking
/// for one.
[[nodiscard]] bool seems_infeasible(const ScaledProblem& p, const Iterate& x);
/// The same in a path's loop: allocates only in its constructor.
class ContradictionScreen {
 public:
  explicit ContradictionScreen(const ScaledProblem& p)
      : y_(p.equalities()), rows_(p.layout.size()), left_(p.variables()) {}

  /// True if the iterate's multipliers exclude feasible points up to some multiple of |z|∞ (scaled): a proof
  /// is then worth its factorizations before the path ends.
  [[nodiscard]] bool suggests_infeasible(const ScaledProblem& p, const Iterate& x);

 private:
  Vector y_, rows_, left_;
};

[[nodiscard]] bool seems_unbounded(const ScaledProblem& p, const Iterate& x);

}  // namespace marble
