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

/// Where a solve was interrupted before it had an exact solution: the next one may go on there.
enum class Stage {
  beginning,        ///< it was not, or there is nothing to go on with
  mending,          ///< in the local search from the solution it started from
  quadratic,        ///< in the interior point method of a problem without pairs
  path,             ///< on the path
  interior_point,   ///< behind it, in the interior point method
  interior_search,  ///< in the local search from there
  soft_search,      ///< in the local search from a soft start
  end_of_path,      ///< on the rest of the path, when nothing else is left
};

class BranchSearch {
 public:
  /// Leans the path where it needs a soft start.
  BranchSearch(const ScaledProblem& problem, Kkt& kkt, const Options& options, PathEngine& path,
               BranchEngines& branch, Incumbent& incumbent);

  /// A solve begins: the next further start is its second.
  void count_from_first() { further_ = 1; }
  /// Better branches than the incumbent's. True if that took a soft start, which borrowed the path.
  bool improve(Run& run, ConstVectorRef initial_z);
  /// A feasible branch by way of an interior point, or one from a soft start. True as above. Where it is
  /// interrupted it changes `stage`, at which it also begins: a later one goes on there.
  bool find(Run& run, ConstVectorRef initial_z, Stage& stage);
  /// From the beginning, and for good.
  bool find(Run& run, ConstVectorRef initial_z) {
    Stage stage = Stage::beginning;
    return find(run, initial_z, stage);
  }
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
  /// where there is one but a cold start, which has reached `cold_objective`, should have its say too. Stage
  /// as of find(), `mending` or `beginning`.
  [[nodiscard]] bool start_from(Run& run, const Iterate& solution, double cold_objective, Stage& stage);
  /// The same, from the beginning and for good.
  [[nodiscard]] bool start_from(Run& run, const Iterate& solution, double cold_objective) {
    Stage stage = Stage::beginning;
    return start_from(run, solution, cold_objective, stage);
  }
  /// What start_from() of the same solution begins with, once some numbers of the problem are new.
  void prepare(Run& run, const Iterate& solution);

 private:
  void from_soft_start(Run& run, ConstVectorRef initial_z, int last_factorization, bool resumes = false);
  int repeat(Run& run, int first, int most_factorizations);
  [[nodiscard]] bool from_interior(Run& run, ConstVectorRef initial_z, Stage& stage);

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
