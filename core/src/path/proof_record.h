// Records the proofs of a solve if its caller requests them: leaves, in the user's units.
#pragma once

#include <limits>

#include "marble/report/proof.h"
#include "marble/solution.h"
#include "model/scaling.h"

namespace marble {

/// Multipliers of one leaf, scaled, of the rows of A and of [C; L; R], and the point at which they bound the
/// objective.
struct LeafMultipliers {
  bool contradiction = false;
  Vector z, y, rows;
  double bound = -std::numeric_limits<double>::infinity();  ///< scaled; unused for a contradiction
};

/// Removes all leaves, before those of another tree or another attempt.
void clear_leaves(Proof& proof);
/// Returns the memory of a leaf.
[[nodiscard]] std::int64_t bytes_of(const ProofLeaf& leaf);
/// Returns the leaf in the user's units, with no side fixed at zero yet.
[[nodiscard]] ProofLeaf leaf_of(const ScaledProblem& problem, const LeafMultipliers& multipliers);
/// Drops all leaves if they exceed most_bytes.
void add_leaf(Proof& proof, std::vector<Index> s_zero, std::vector<Index> t_zero, ProofLeaf leaf);
/// Adds a contradiction by its multipliers (y, ν, ξ, η) in the user's units.
void add_contradiction(Proof& proof, const ScaledProblem& problem, std::vector<Index> s_zero,
                       std::vector<Index> t_zero, const std::vector<double>& multipliers);

/// Sets, at the end of a solve, what the leaves claim, according to its solution.
void conclude(Proof& proof, const ScaledProblem& problem, const Solution& solution);

}  // namespace marble
