// Local minima elsewhere, for where Q is not convex: what makes a branch elastic and hardens it again stays
// in its basin there. A start is a random point, the nearest feasible one on a branch near it, a descent
// along negative curvature, and then the neighbouring branches: the same from the minimum with one pair
// flipped, for as long as that is lower. A minimum that an earlier start has ended in is not searched again.
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
  /// Works on `point`, which `kkt` factorizes; offers what it finds to the incumbent. For one solve.
  Multistart(const ScaledProblem& problem, Kkt& kkt, BranchPoint& point, Incumbent& incumbent);

  /// The next start, up to the run's given count of factorizations: first the neighbours of the incumbent's
  /// branch, then random points around it, always the same ones. True if the incumbent is a better one.
  bool next(Run& run, int last_factorization);

 private:
  [[nodiscard]] bool start(Run& run, int last);
  [[nodiscard]] bool prepare(Run& run);
  [[nodiscard]] bool minimize(Run& run, ConstVectorRef target, const WorkingSet* branch, int last);
  void search_neighbours(Run& run, int last);
  [[nodiscard]] bool is_searched() const;

  const ScaledProblem& problem_;
  Incumbent& incumbent_;
  ScaledProblem nearest_;  // the same rows; its cost is the distance from a point
  std::unique_ptr<Kkt> nearest_kkt_;
  std::unique_ptr<BranchEngines> nearest_engines_;
  Descent descent_;
  Iterate x_;  // the start's best minimum, where found_
  Images images_;
  WorkingSet set_;
  bool found_ = false;
  std::vector<double> searched_;  // objectives of minima that none of their neighbours is lower than
  std::uint64_t number_ = 0;
};

}  // namespace marble
