// A tree over sets of pairs of which one must have its strong side at zero, for when nothing else has found a
// feasible branch.
//
// Sums of switches that must be 1 bring such sets forth: of the steps of a plan at which a gate may be passed
// one must be taken. Fixing the weak side of one pair says nothing, so that a tree over single pairs has no
// end. A set is found as the sides that a contradiction needs of all weak sides at zero. Depth first, a child
// for each member of the smallest set, then over single pairs. A node is a projection; one that contradicts
// itself leaves a nogood, the sides that it needs; a fork that is refuted leaves what its children need but
// for the fork's own sides; both end later nodes that have these sides (Marques-Silva and Sakallah, "GRASP",
// 1999, for clauses; for sets: Beale and Forrest, "Global optimization using special ordered sets", 1976).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "global/nogoods.h"
#include "global/projection.h"
#include "model/working_set.h"

namespace marble {

class SetTree {
 public:
  explicit SetTree(const ScaledProblem& problem);

  enum class End {
    found,    ///< a branch that was accepted
    refuted,  ///< every branch is proved to be infeasible
    stopped,  ///< by its budget, there are no sets, or not every end was a proof
  };
  /// Whether a branch that is feasible in z, both scaled, is one to end with.
  using Accept = std::function<bool(ConstVectorRef z, const WorkingSet& branch)>;
  /// Searches from z (scaled), in no more nodes than this.
  [[nodiscard]] End run(Run& run, ConstVectorRef z, std::int64_t most_nodes, const Accept& accept);

  /// Whether it would not take too much memory.
  [[nodiscard]] bool applies(const Run& run) const;
  [[nodiscard]] std::int64_t nodes() const { return nodes_; }  ///< of the last run()
  /// Of a run that refuted: no z with |z|∞ up to this is feasible, user units.
  [[nodiscard]] double radius() const { return projection_->radius(); }

 private:
  /// What refutes a node, for a proof that is recorded: multipliers, or a fork's children, each with the side
  /// that it fixes; every child has the opposite sides of those before it, the last one nothing else.
  struct Reason {
    std::optional<ProofLeaf> leaf;
    std::vector<std::pair<Index, std::shared_ptr<const Reason>>> children;
  };
  /// Sides that cannot all be zero, ascending: 2 k is s of pair k, 2 k + 1 is t.
  struct Nogood {
    std::vector<Index> sides;
    std::shared_ptr<const Reason> reason;
  };
  struct Clause {
    std::vector<Index> weak;  // sides
    std::shared_ptr<const Reason> reason;
  };
  /// Sides in the order of the children, and what refutes the rest.
  struct Fork {
    std::vector<Index> sides;
    Nogood rest;
  };

  [[nodiscard]] bool find_clauses();
  [[nodiscard]] std::optional<Nogood> refute();
  [[nodiscard]] std::optional<Nogood> branch(const Fork& fork);
  [[nodiscard]] std::optional<Nogood> branch_on_pair(Index pair);
  [[nodiscard]] std::optional<Fork> choose_clause();
  [[nodiscard]] bool try_smaller_sides(Index& pair);
  [[nodiscard]] const Nogood* known() const;
  [[nodiscard]] Nogood learn_contradiction();
  void learn(const Nogood& nogood);
  void fix(Index side);
  [[nodiscard]] Index row_of(Index side) const;
  [[nodiscard]] std::uint8_t& zero_of(Index side) { return zero_[static_cast<std::size_t>(side / 2)]; }
  [[nodiscard]] bool is_over();
  void record(const Reason& reason, std::vector<std::uint8_t> zero) const;

  const ScaledProblem& problem_;
  std::optional<Projection> projection_;
  const Accept* accept_ = nullptr;
  Run* run_ = nullptr;
  std::vector<std::uint8_t> zero_;  // of each pair: 1 where s, 2 where t is zero in this node
  std::vector<double> weight_;      // of each pair: 1 + in how many nogoods it was
  std::vector<Clause> clauses_;
  std::vector<Nogood> nogoods_;
  NogoodMemory memory_;
  double state_bytes_ = 0.0;  // of the forks above this node
  std::int64_t reason_bytes_ = 0;
  bool found_ = false;
  std::int64_t nodes_ = 0, most_nodes_ = 0;
};

}  // namespace marble
