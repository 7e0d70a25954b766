// From the end of a path to a vertex of its branch: exact complementarity, exact feasibility, exact
// multipliers.
#pragma once

#include "active_set.h"

namespace marble {

class Polish {
 public:
  Polish(const ScaledProblem& problem, Kkt& kkt);

  /// Reads the partition off an interior iterate, solves its piece, and moves biactive pairs to their other
  /// branch while a multiplier shows descent there and the objective falls. True if x() is an exact solution
  /// of its piece; at most `budget` factorizations.
  [[nodiscard]] bool run(const Iterate& iterate, Run& run, int budget);

  [[nodiscard]] const Iterate& x() const { return active_set_.x(); }
  [[nodiscard]] const Images& images() const { return active_set_.images(); }

 private:
  [[nodiscard]] bool improve(Run& run, int last_factorization);
  [[nodiscard]] bool try_flips(Run& run, int last_factorization);
  void collect_wrong_signs();

  ActiveSet active_set_;
  Iterate best_;
  WorkingSet best_set_;
  double best_objective_ = 0.0;
  struct Candidate {
    Index pair;
    double descent;  // size of the wrong-signed multiplier
  };
  std::vector<Candidate> candidates_;
};

}  // namespace marble
