// Generates coupled problems from seeds, the same on every machine.
#pragma once

#include <cstdint>
#include <vector>

#include "marble/composite/coupled.h"

namespace marble::testing {

struct OwnedCoupled {
  std::vector<OwnedProblem> blocks;
  std::vector<SparseMatrix> coupling;
  std::vector<double> coupling_rhs;

  /// This must outlive the view.
  [[nodiscard]] CoupledView view() const;
};

struct CoupledSizes {
  Index blocks = 3;
  Index variables = 4;  ///< per block
  Index pairs = 2;      ///< per block
  Index rows = 2;       ///< coupling rows
};

/// Dense blocks with Q = WWᵀ/n + ½I; sides, coupling rows and their coupling_rhs are random, of unit
/// variance.
[[nodiscard]] OwnedCoupled random_coupled(const CoupledSizes& sizes, std::uint64_t seed);

/// Hoppers with a common budget: in each step the vertical forces of their legs, N, sum to at most the
/// budget. Hopper k is that of seed k; a last block without cost takes the rest of the budget.
[[nodiscard]] OwnedCoupled hoppers_on_a_budget(int hoppers, int steps, double budget);

}  // namespace marble::testing
