// What a solve keeps of its proofs, if its caller asks for them: leaves, in the user's units.
#pragma once

#include <limits>

#include "data/scaling.h"
#include "marble/report/proof.h"
#include "marble/solution.h"

namespace marble {

/// Multipliers of one leaf, scaled, of the rows of A and of [C; L; R], and the point they bound the objective
/// at.
struct LeafMultipliers {
  bool contradiction = false;
  Vector z, y, rows;
  double bound = -std::numeric_limits<double>::infinity();  ///< scaled, where it is no contradiction
};

/// Leaves of another tree, or of another try, replace those there are.
void clear_leaves(Proof& proof);
/// Memory that it takes.
[[nodiscard]] std::int64_t bytes_of(const ProofLeaf& leaf);
/// In the user's units; no side is at zero yet.
[[nodiscard]] ProofLeaf leaf_of(const ScaledProblem& problem, const LeafMultipliers& multipliers);
/// Beyond most_bytes it drops them all.
void add_leaf(Proof& proof, std::vector<Index> s_zero, std::vector<Index> t_zero, ProofLeaf leaf);
/// The same of multipliers (y, ν, ξ, η) of a contradiction in the user's units.
void add_contradiction(Proof& proof, const ScaledProblem& problem, std::vector<Index> s_zero,
                       std::vector<Index> t_zero, const std::vector<double>& multipliers);

/// At the end of a solve: what its leaves claim, by its solution.
void conclude(Proof& proof, const ScaledProblem& problem, const Solution& solution);

}  // namespace marble
