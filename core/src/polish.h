// From the end of a path to a vertex of its branch: exact complementarity, exact feasibility, exact
// multipliers.
#pragma once

#include "active_set.h"

namespace marble {

class Polish {
 public:
  Polish(const ScaledProblem& problem, Kkt& kkt);

  /// Reads the partition off an interior iterate and solves its piece with at most `budget` factorizations.
  /// Then searches among partitions: flips pairs whose multiplier shows descent on the other branch while the
  /// objective falls, with at most `search_budget` factorizations. True if x() is an exact solution of its
  /// piece.
  [[nodiscard]] bool run(const Iterate& iterate, Run& run, int budget, int search_budget);

  [[nodiscard]] const Iterate& x() const { return active_set_.x(); }
  [[nodiscard]] const Images& images() const { return active_set_.images(); }

 private:
  void collect_candidates();
  [[nodiscard]] bool improve(Run& run, int last_factorization);
  [[nodiscard]] bool flips_help(std::size_t first, std::size_t count, Run& run, int last_factorization);

  ActiveSet active_set_;
  Iterate best_;
  WorkingSet best_set_;
  double best_objective_ = 0.0;
  struct Candidate {
    Index pair;
    double rank;  // higher is tried first
  };
  std::vector<Candidate> candidates_;
};

}  // namespace marble
