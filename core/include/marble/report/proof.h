// The proof of a solve, leaf by leaf, for independent checks: see "Proofs in files" in ALGORITHM.md.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "marble/problem.h"

namespace marble {

/// The nonzero entries of a vector, ascending.
struct SparseNumbers {
  std::vector<Index> indices;
  std::vector<double> values;
  bool operator==(const SparseNumbers&) const = default;
};

/// One or several branches: some pairs have one side fixed at zero, the others have both sides ≥ 0. All
/// numbers are in the user's units.
struct ProofLeaf {
  std::vector<Index> s_zero, t_zero;  ///< pairs with (L z + l)ᵢ = 0, and with (R z + r)ᵢ = 0
  /// True if the multipliers contradict the rows (Farkas); otherwise they bound the objective from below.
  bool contradiction = false;
  /// The point at which the bound is taken; only entries in columns of Q matter. Empty for a contradiction.
  SparseNumbers z;
  SparseNumbers y;            ///< of A z + b = 0
  SparseNumbers nu, xi, eta;  ///< of the rows of C, L and R; ≥ 0 except for sides at zero
};

/// A proof, which a solve fills if SolveControls::proof requests it.
struct Proof {
  /// What all leaves together prove.
  enum class Claim {
    none,        ///< nothing: `reason` says why
    bound,       ///< no feasible point has an objective below `bound`
    infeasible,  ///< there is no feasible point: every leaf is a contradiction
  };

  /// Memory limit for the leaves, ≥ 0; if they would take more, there is no proof.
  std::int64_t most_bytes = std::int64_t{1} << 28;

  Claim claim = Claim::none;
  std::string reason = "the solve did not begin";
  double bound = -std::numeric_limits<double>::infinity();  ///< as in the solution
  /// Where rows leave a variable unbounded, the solver charges the rounding of multipliers up to this |z|∞,
  /// and claims no more. A checker needs it only if it cannot repair the multipliers. +∞ if rows bound all
  /// variables.
  double radius = std::numeric_limits<double>::infinity();
  std::vector<ProofLeaf> leaves;  ///< together they cover every branch
  std::int64_t bytes = 0;         ///< memory of the leaves
};

}  // namespace marble
