// Solves small problems on which the other engines fail, mostly because of nearly dependent rows. A dense
// active set method, whose accuracy does not depend on a penalty, solves their branches.
#pragma once

#include <vector>

#include "search/dense_active_set.h"
#include "search/incumbent.h"
#include "search/null_space.h"

namespace marble {

class DenseSearch {
 public:
  DenseSearch(const ScaledProblem& problem, Incumbent& incumbent);

  /// True if the problem is small enough for dense factors.
  [[nodiscard]] static bool fits(const ScaledProblem& problem);

  /// Solves the branch of `set` and offers the solution to the incumbent.
  void solve_branch(Run& run, const WorkingSet& set);
  /// The same over all branches, the more promising ones first, up to the limit of nodes.
  void search(Run& run);

 private:
  using Kind = DenseActiveSet::Kind;
  enum class Outcome { optimal, infeasible, failed };

  [[nodiscard]] bool factor(Run& run);
  [[nodiscard]] Outcome minimize(Run& run, const std::vector<Kind>& kinds);
  [[nodiscard]] bool is_optimal(const std::vector<Kind>& kinds, const StationaryPoint& point) const;
  [[nodiscard]] std::vector<Kind> kinds_of(const WorkingSet& set) const;
  [[nodiscard]] Index most_violated_pair(const std::vector<Kind>& kinds) const;
  void offer(const WorkingSet& branch);

  const ScaledProblem& problem_;
  Incumbent& incumbent_;
  RowAccess rows_;
  DenseActiveSet engine_;
  double delta_ = 0.0;
  bool factored_ = false;
  Iterate x_;
  Images images_;
};

}  // namespace marble
