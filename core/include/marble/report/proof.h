// What a solve has proved, case by case, for others to check: see "Proofs in files" in ALGORITHM.md.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "marble/problem.h"

namespace marble {

/// The entries of a vector that are not zero, ascending.
struct SparseNumbers {
  std::vector<Index> indices;
  std::vector<double> values;
  bool operator==(const SparseNumbers&) const = default;
};

/// A branch, or several: some pairs have a side at zero, the others both sides ≥ 0. All in the user's units.
struct ProofLeaf {
  std::vector<Index> s_zero, t_zero;  ///< pairs with (L z + l)ᵢ = 0, and with (R z + r)ᵢ = 0
  /// Whether the multipliers contradict the rows (Farkas), else they bound the objective from below.
  bool contradiction = false;
  /// The point that the bound is taken at, of which only entries in columns of Q matter. Empty of a
  /// contradiction.
  SparseNumbers z;
  SparseNumbers y;            ///< of A z + b = 0
  SparseNumbers nu, xi, eta;  ///< of the rows of C, L and R; ≥ 0 but for sides at zero
};

/// Given to a solve by SolveControls::proof, filled by it.
struct Proof {
  /// What all leaves together prove.
  enum class Claim {
    none,        ///< nothing: `reason` says why
    bound,       ///< no feasible point has an objective below `bound`
    infeasible,  ///< there is no feasible point: each leaf is a contradiction
  };

  /// Of memory that the leaves may take, ≥ 0: where they would take more there is no proof.
  std::int64_t most_bytes = std::int64_t{1} << 28;

  Claim claim = Claim::none;
  std::string reason = "the solve did not begin";
  double bound = -std::numeric_limits<double>::infinity();  ///< as the solution's
  /// Where rows leave a variable unbounded the solver pays for the rounding of multipliers up to this |z|∞,
  /// and claims no more. A checker needs it only if it cannot repair them. +∞ where rows bound all of them.
  double radius = std::numeric_limits<double>::infinity();
  std::vector<ProofLeaf> leaves;  ///< together they cover every branch
  std::int64_t bytes = 0;         ///< that they take
};

}  // namespace marble
