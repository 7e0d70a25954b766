// What is tried where the path and the interior point have found no feasible branch, and whose success does
// not depend on the objective: Lemke's method where the problem allows it, the engines on a problem whose
// only cost is the distance from 0, a tree over the pairs.
#pragma once

#include <string>

#include "global/pair_tree.h"
#include "global/set_tree.h"
#include "search/incumbent.h"

namespace marble {

class Feasibility {
 public:
  /// Offers what it finds to the incumbent, which works on `point`.
  Feasibility(const ScaledProblem& problem, const Options& options, BranchPoint& point, Incumbent& incumbent);

  enum class End {
    solved,    ///< a branch that the incumbent could be solved on
    feasible,  ///< one that it could not: `point` is feasible
    refuted,   ///< every branch is proved to be infeasible
    none,      ///< nothing within the budget
  };
  /// Searches from z (scaled).
  [[nodiscard]] End run(Run& run, ConstVectorRef z);
  /// What the last run(), which ended so, did and proved, for people.
  [[nodiscard]] std::string describe(End end) const;

 private:
  [[nodiscard]] bool take(Run& run, ConstVectorRef z, const WorkingSet& branch, const char* origin);
  [[nodiscard]] bool pivot(Run& run, ConstVectorRef z, int first, int end, int last_factorization);
  [[nodiscard]] bool pivot_carefully(Run& run, ConstVectorRef z, int last_factorization);
  [[nodiscard]] bool solve_calm(Run& run, ConstVectorRef z, bool user_units);
  [[nodiscard]] PairTree::End search_tree(Run& run, ConstVectorRef z, int last_factorization);
  [[nodiscard]] SetTree::End search_sets(Run& run, ConstVectorRef z);

  const ScaledProblem& problem_;
  const Options& options_;
  BranchPoint& point_;
  Incumbent& incumbent_;
  PairTree tree_;
  SetTree sets_;
  int factorizations_ = 0;
  double radius_ = 0.0;  // of the refutation
};

}  // namespace marble
