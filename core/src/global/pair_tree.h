// A tree over the pairs, if no other method has found a feasible branch. In each node, some pairs have one
// side fixed at zero, and both sides of the others are free.
//
// Depth first. A node is the elastic relaxation, started from its parent's optimum. A node that cannot be
// feasible is cut, with a proof if its multipliers are one. Any other node is divided at the pair that is
// farthest from complementary. If all leaves are cut by proofs, there is no feasible point.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "branch/branch_engines.h"
#include "path/certificate.h"
#include "path/proof_record.h"

namespace marble {

class PairTree {
 public:
  explicit PairTree(const ScaledProblem& problem);

  enum class End {
    found,    ///< a branch was accepted
    refuted,  ///< every branch is proved infeasible
    stopped,  ///< by its budget, or because not every leaf has a proof
  };
  /// Decides whether a branch whose relaxation is feasible in z (both scaled) ends the search.
  using Accept = std::function<bool(ConstVectorRef z, const WorkingSet& branch)>;
  /// Searches from z (scaled), up to the run's given count of factorizations. Takes its memory from
  /// Run::bytes_left; stops at once if that is too little.
  [[nodiscard]] End run(Run& run, ConstVectorRef z, int last_factorization, const Accept& accept);

  [[nodiscard]] int nodes() const { return nodes_; }  ///< of the last run()
  /// After a run that refuted all branches: no z with |z|∞ up to this is feasible, user units, rounding
  /// included.
  [[nodiscard]] double radius() const { return radius_; }

 private:
  // A node whose other child is still to be visited.
  struct Fork {
    Iterate x;
    WorkingSet set;
    Index side;  // of that child
  };
  enum class Node { feasible, cut, failed };
  [[nodiscard]] double fork_bytes() const;
  [[nodiscard]] bool prepare(Run& run);
  [[nodiscard]] Node solve(Run& run, int last_factorization);
  [[nodiscard]] Index worst_pair(double& apart) const;
  [[nodiscard]] bool is_open(Index pair) const;
  [[nodiscard]] Index smaller_side(Index pair) const;
  void fix(Index side);
  void record(Proof& proof, const FarkasProof& found) const;
  void branch_of(WorkingSet& branch) const;
  [[nodiscard]] bool back();

  const ScaledProblem& problem_;
  ScaledProblem relaxed_;  // its pairs are the sides, each with 0: fixed, or free
  std::unique_ptr<Kkt> kkt_;
  std::unique_ptr<BranchEngines> engines_;
  std::vector<Fork> forks_;
  bool proved_ = true;
  double radius_ = 0.0;
  int nodes_ = 0;
};

}  // namespace marble
