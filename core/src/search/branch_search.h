// Searches for branches better than the path's, or for a feasible one if the path's is infeasible: local
// searches from the incumbent, a soft start, an interior point and a previous solution.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "path/interior.h"
#include "path/path.h"
#include "search/further_starts.h"
#include "search/incumbent.h"
#include "search/local_search.h"
#include "search/penalty_homotopy.h"

namespace marble {

/// The stage at which a solve was interrupted before it had an exact solution; the next solve may resume
/// there.
enum class Stage {
  beginning,        ///< not interrupted, or nothing to resume
  mending,          ///< restoring feasibility by a local search from the starting solution
  quadratic,        ///< in the interior point method of a problem without pairs
  path,             ///< on the path
  interior_point,   ///< after the path, in the interior point method
  interior_search,  ///< in the local search from the interior point
  soft_search,      ///< in the local search from a soft start
  end_of_path,      ///< on the rest of the path, after all other engines
};

class BranchSearch {
 public:
  /// Biases the path when it needs a soft start.
  BranchSearch(const ScaledProblem& problem, Kkt& kkt, const Options& options, PathEngine& path,
               BranchEngines& branch, Incumbent& incumbent);

  /// Call this at the beginning of a solve from z: its next further start is number two, and its random
  /// points are around z.
  void begin(ConstVectorRef z);
  /// Searches for branches better than the incumbent's. Returns true if that took a soft start, which uses
  /// the path.
  bool improve(Run& run, ConstVectorRef initial_z);
  /// Searches for a feasible branch from an interior point or a soft start. Returns true as above. It begins
  /// at `stage`; if it is interrupted, it sets `stage`, at which a later call resumes.
  bool find(Run& run, ConstVectorRef initial_z, Stage& stage);
  /// The same from the beginning, without resuming.
  bool find(Run& run, ConstVectorRef initial_z) {
    Stage stage = Stage::beginning;
    return find(run, initial_z, stage);
  }
  /// Searches for a better branch beside an incumbent that solves by segments have found: from a soft start
  /// alone, which uses the path, as long as that may still end below the incumbent.
  void search_beside_segments(Run& run, ConstVectorRef initial_z);
  /// Runs a few further starts, as long as they gain, if a soft start came first and was cheap.
  void repeat_soft_start(Run& run, bool after_soft_start);
  /// Searches from the end of a penalty homotopy, if that applies, with at most as many factorizations as the
  /// run has taken so far. Further starts follow if this gave a better branch.
  void from_penalties(Run& run, ConstVectorRef initial_z);
  /// Runs further starts one by one within option effort, as long as they gain. Calls `settle` after
  /// each that replaces the incumbent.
  void start_again(Run& run, const std::function<void()>& settle);
  /// Runs the requested further starts from the incumbent, in rounds. Calls `settle` after each that replaces
  /// it.
  void start_further(Run& run, const std::function<void()>& settle);
  /// Runs one round of further starts. Returns true if it replaced the incumbent.
  [[nodiscard]] bool start_round(Run& run, int count, const std::function<void()>& settle);
  /// Starts from the branch of a solution of this problem or of a similar one, and searches for better ones
  /// every few such steps, or if the objective has risen clearly above `reference_objective`. Returns false
  /// if no feasible branch is near, or if the one found is clearly above the reference and few pairs pull or
  /// the reference is -infinity: a cold start should follow. `stage` as in find(): `mending` or `beginning`.
  [[nodiscard]] bool start_from(Run& run, const Iterate& solution, double reference_objective, Stage& stage);
  /// The same from the beginning, without resuming.
  [[nodiscard]] bool start_from(Run& run, const Iterate& solution, double reference_objective) {
    Stage stage = Stage::beginning;
    return start_from(run, solution, reference_objective, stage);
  }
  /// Starts from the best branch of solutions of similar problems, the nearest one first, or from one near
  /// the first solution if all are infeasible, and switches pairs from there. Returns false if no feasible
  /// branch is near. What it finds does not depend on earlier solves.
  /// `compares_more`: takes the best of more branches, even if the nearest two solutions have the same one.
  [[nodiscard]] bool start_near(Run& run, std::span<const Iterate> solutions, bool compares_more);
  /// True if the last start_from() has searched, to the end.
  [[nodiscard]] bool has_searched() const { return has_searched_; }
  /// Call this before a cold start, with which a sequence begins.
  void forget_steps() { steps_ = 0; }
  /// Solves the branch of a solution of a similar problem with at most this number of factorizations.
  /// Returns true if its solution is kept.
  [[nodiscard]] bool take_branch_of(Run& run, const Iterate& solution, int budget);
  /// Searches for better branches near the incumbent and, if many of its pairs pull, from a soft start.
  void search_near(Run& run, ConstVectorRef initial_z);
  /// False if no branch is better than the incumbent's, given that Q is convex. Takes a factorization if the
  /// last one is not of the incumbent's rows.
  [[nodiscard]] bool may_improve(Run& run);
  /// Switches pairs of the incumbent, as long as that gains.
  void switch_pulling(Run& run);
  /// Prepares start_from() of the same solution, before the last numbers of the problem are set.
  void prepare(Run& run, const Iterate& solution);

 private:
  void from_soft_start(Run& run, ConstVectorRef initial_z, int last_factorization, bool resumes = false,
                       double cutoff = std::numeric_limits<double>::infinity());
  void search_below_incumbent(Run& run, ConstVectorRef initial_z, int last_factorization);
  void search_around_incumbent(Run& run);
  [[nodiscard]] bool is_search_due(const Iterate& last);
  [[nodiscard]] bool restore_feasibility(Run& run, const Iterate& solution, bool resumes, Stage& stage);
  void switch_near_incumbent(Run& run, int patience, int last_factorization, const char* origin);
  int repeat(Run& run, int first, int most_factorizations);
  [[nodiscard]] FurtherStarts::Start next_start();
  [[nodiscard]] bool run_round(Run& run, int count, int most_factorizations, int made, int asked,
                               const std::function<void()>& settle);
  [[nodiscard]] bool from_interior(Run& run, ConstVectorRef initial_z, Stage& stage);

  const ScaledProblem& problem_;
  const Options& options_;
  PathEngine& path_;
  BranchPoint& point_;
  Incumbent& incumbent_;
  InteriorEngine interior_;
  LocalSearch search_;
  FurtherStarts further_starts_;
  int steps_ = 0;      // of a sequence since its last search
  Vector searched_z_;  // the solution after that search
  bool has_searched_ = false;
  std::unique_ptr<PenaltyHomotopy> homotopy_;  // if it applies
  int further_ = 1;                            // starts of this solve, including the first one
  struct Tried {
    int number = 0, tries = 0, gains = 0;
  };
  Tried softened_ = {}, random_ = {};  // the further starts of this solve by kind
};

}  // namespace marble
