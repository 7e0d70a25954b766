// Coupled problems by seed, the same on every machine.
#pragma once

#include <cstdint>
#include <vector>

#include "marble/composite/coupled.h"

namespace marble::testing {

struct OwnedCoupled {
  std::vector<OwnedProblem> blocks;
  std::vector<SparseMatrix> coupling;
  std::vector<double> total;

  /// It must outlive the view.
  [[nodiscard]] CoupledView view() const;
};

struct CoupledSizes {
  Index blocks = 3;
  Index variables = 4;  ///< of a block
  Index pairs = 2;      ///< of a block
  Index rows = 2;       ///< between blocks
};

/// Dense blocks with Q = WWᵀ/n + ½I; sides, coupling rows and their total at random, of unit variance.
[[nodiscard]] OwnedCoupled random_coupled(const CoupledSizes& sizes, std::uint64_t seed);

/// Hoppers on one supply: in each step their legs' vertical forces, N, sum to at most the budget. Hopper k is
/// that of seed k; a last block without cost has what is left of the budget.
[[nodiscard]] OwnedCoupled hoppers_on_a_budget(int hoppers, int steps, double budget);

}  // namespace marble::testing
