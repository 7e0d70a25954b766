// Searches for other local minima, for a nonconvex Q: softening and hardening a branch stays in its basin
// there. A start takes a random point, the nearest feasible point on a branch near it, and a descent along
// negative curvature. Then it tries the neighbouring branches: the same from the minimum with one pair
// switched, as long as the objective falls. A minimum in which an earlier start has ended is not searched
// again.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "branch/branch_engines.h"
#include "proof/descent.h"
#include "search/incumbent.h"

namespace marble {

class Multistart {
 public:
  /// Works on `point`, which `kkt` factorizes; offers its minima to the incumbent. For one solve.
  Multistart(const ScaledProblem& problem, Kkt& kkt, BranchPoint& point, Incumbent& incumbent);

  /// Runs the next start, up to the run's given count of factorizations: first the neighbours of the
  /// incumbent's branch, then random points around it, the same in every run. Returns true if it improved the
  /// incumbent.
  bool next(Run& run, int last_factorization);

 private:
  [[nodiscard]] bool start(Run& run, int last);
  [[nodiscard]] bool prepare(Run& run);
  [[nodiscard]] bool minimize(Run& run, ConstVectorRef target, const WorkingSet* branch, int last);
  void search_neighbours(Run& run, int last);
  [[nodiscard]] bool is_searched() const;

  const ScaledProblem& problem_;
  Incumbent& incumbent_;
  ScaledProblem nearest_;  // the same rows; its cost is the distance to a point
  std::unique_ptr<Kkt> nearest_kkt_;
  std::unique_ptr<BranchEngines> nearest_engines_;
  Descent descent_;
  Iterate x_;  // the start's best minimum, if found_
  Images images_;
  WorkingSet set_;
  bool found_ = false;
  std::vector<double> searched_;  // objectives of minima without a lower neighbour
  std::uint64_t number_ = 0;
};

}  // namespace marble
