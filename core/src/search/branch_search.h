// The ways of a solve to better branches than the path's, and to one where the path's is infeasible: local
// searches from the incumbent, from a soft start, from an interior point and from a last answer.
#pragma once

#include <functional>
#include <memory>

#include "path/interior.h"
#include "path/path.h"
#include "search/further_starts.h"
#include "search/incumbent.h"
#include "search/local_search.h"
#include "search/penalty_homotopy.h"

namespace marble {

class BranchSearch {
 public:
  /// Leans the path where it needs a soft start.
  BranchSearch(const ScaledProblem& problem, Kkt& kkt, const Options& options, PathEngine& path,
               BranchEngines& branch, Incumbent& incumbent);

  /// A solve begins: the next further start is its second.
  void count_from_first() { further_ = 1; }
  /// Better branches than the incumbent's. True if that took a soft start, which borrowed the path.
  bool improve(Run& run, ConstVectorRef initial_z);
  /// A feasible branch by way of an interior point, or one from a soft start. True as above.
  bool find(Run& run, ConstVectorRef initial_z);
  /// Further starts where a soft start came first and was cheap: a few, while they gain.
  void repeat_soft_start(Run& run, bool after_soft_start);
  /// A search from the end of a penalty homotopy, where that applies, for at most as many factorizations as
  /// the run has taken so far, and further starts where it brought a better branch.
  void from_penalties(Run& run, ConstVectorRef initial_z);
  /// Those asked for, from the incumbent, in rounds. `settle` is called after each that replaces it.
  void start_further(Run& run, const std::function<void()>& settle);
  /// One round of them, asked for or not. True if it replaced the incumbent.
  [[nodiscard]] bool start_round(Run& run, int count, const std::function<void()>& settle);
  /// From the branch of a solution of this problem or one like it. False where no feasible branch is near, or
  /// where there is one but a cold start, which has reached `cold_objective`, should have its say too.
  [[nodiscard]] bool resume(Run& run, const Iterate& solution, double cold_objective);
  /// What resume() of the same solution begins with, once some numbers of the problem are new.
  void prepare(Run& run, const Iterate& solution);

 private:
  void from_soft_start(Run& run, ConstVectorRef initial_z, int last_factorization);
  int repeat(Run& run, int first, int most_factorizations);
  [[nodiscard]] bool from_interior(Run& run, ConstVectorRef initial_z);

  const ScaledProblem& problem_;
  const Options& options_;
  PathEngine& path_;
  BranchPoint& point_;
  Incumbent& incumbent_;
  InteriorEngine interior_;
  LocalSearch search_;
  FurtherStarts further_starts_;
  std::unique_ptr<PenaltyHomotopy> homotopy_;  // where it applies
  int further_ = 1;                            // starts of this solve, the first one included
};

}  // namespace marble
