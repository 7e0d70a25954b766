// The work of one node: its relaxation is solved again from the rows that its parent held, a pair is chosen,
// and both children are bounded. The expansions of a round do not exchange information, so they may run at
// once.
#pragma once

#include <optional>

#include "global/clauses.h"
#include "global/node.h"
#include "global/pseudo_costs.h"
#include "global/relaxation.h"

namespace marble {

/// A candidate solution from a node's relaxation: a branch, given by the smaller sides, and a starting point
/// on it.
struct Suggestion {
  Vector z, y, multipliers;
  std::vector<Index> held;
};

struct Expansion {
  /// Inputs, which the tree sets.
  Node node;
  const NodeEngine::Center* center = nullptr;
  const Box* box = nullptr;
  const PseudoCosts* costs = nullptr;
  const std::vector<Clause>* clauses = nullptr;
  std::int64_t most_children = 2;
  double cutoff = 0.0;   ///< scaled objective: nodes that are not below it are closed
  bool suggest = false;  ///< whether its point is tried as a solution even if it is not complementary
  bool keep = false;     ///< whether nodes keep their multipliers, and closed nodes are returned
  bool record = false;   ///< whether they keep their whole proofs

  /// Results.
  enum class Outcome {
    branched,       ///< it has children, some of which may be closed
    closed,         ///< by its own bound, or infeasible
    complementary,  ///< its point is a suggestion that may close it
    leaf,           ///< no pair is left to branch on
    interrupted,    ///< as if it had not begun
  };
  Outcome outcome = Outcome::interrupted;
  double closed_bound = 0.0;  ///< lowest bound of the closed nodes; +∞ if none or infeasible
  std::vector<Node> children, closed;
  int bounded = 0;  ///< children that were bounded
  std::vector<PseudoCosts::Gain> gains;
  std::int64_t factorizations = 0;
  std::optional<Suggestion> suggestion;
};

/// Makes expansions, one after the other.
class Expander {
 public:
  Expander(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt, Gram& gram);

  [[nodiscard]] NodeEngine& relaxation() { return *relaxation_; }
  void expand(Expansion& expansion, const Interrupt& interrupt);

  /// Returns the suggestion of the relaxation solved last.
  [[nodiscard]] Suggestion suggestion() const;
  /// Tries both sides of each pair. If one side cannot be zero below the cutoff, the other one is fixed.
  /// Returns false if neither can: no solution is left. Repeats this in rounds, as long as they fix enough.
  [[nodiscard]] bool probe(Fixings& fixings, const Box& box, double cutoff, double& closed_bound,
                           const Interrupt& interrupt);
  /// The gains that probe() found for each side that it could not fix.
  [[nodiscard]] const std::vector<PseudoCosts::Gain>& probed() const { return probed_; }
  /// Returns the nodes that probe() or the last expansion closed, with their proofs.
  [[nodiscard]] std::vector<Node> take_closed() { return std::exchange(closed_, {}); }
  /// From now on nodes keep their multipliers and, if a box is given to bound them in, their whole proofs.
  /// Until the next call, the proof of a node is `inherited` or its own.
  void keep(bool keep, const Box* record, std::shared_ptr<const LeafMultipliers> inherited) {
    keep_ = keep;
    record_ = record;
    relaxation_->keep_best(record != nullptr);
    inherited_ = std::move(inherited);
  }
  /// Returns a node for the relaxation solved last.
  [[nodiscard]] Node node(const Fixings& fixings, NodeEngine::End end) const;
  /// Finds clauses among the pairs that are not fixed, by the gains that probe() found; each pair is in at
  /// most one.
  [[nodiscard]] std::vector<Clause> find_clauses(const Fixings& fixings, const NodeEngine::Center& center,
                                                 const Box& box, const Interrupt& interrupt);

 private:
  struct Choice {
    Index pair = -1;
    double gain = 0.0;  // of the side that gains less
  };
  void expand_node(Expansion& expansion, const Interrupt& interrupt);
  [[nodiscard]] Choice choose(const Expansion& expansion) const;
  struct ClauseChoice {
    const Clause* clause = nullptr;
    std::vector<Clause::Member> open;
  };
  [[nodiscard]] ClauseChoice choose_clause(const Expansion& expansion, double gain) const;
  void fix(const Fixings& fixings);
  void expand_clause(Expansion& expansion, const ClauseChoice& choice, const Interrupt& interrupt);
  void close(const Fixings& fixings, NodeEngine::End end);
  [[nodiscard]] std::shared_ptr<const LeafMultipliers> record(const Fixings& fixings) const;
  [[nodiscard]] std::shared_ptr<const LeafMultipliers> contradiction() const;
  [[nodiscard]] bool bound_child(Expansion& expansion, Index pair, bool s, const Interrupt& interrupt);
  [[nodiscard]] bool is_feasible(Fixings fixings, const std::vector<Clause::Member>& weak,
                                 const NodeEngine::Center& center, const Box& box,
                                 const Interrupt& interrupt);
  [[nodiscard]] std::vector<Clause::Member> shrink(const Fixings& fixings,
                                                   std::vector<Clause::Member> members,
                                                   const NodeEngine::Center& center, const Box& box,
                                                   const Interrupt& interrupt);
  void skip_idle(const Fixings& fixings, double rise, const Interrupt& interrupt);
  [[nodiscard]] std::optional<int> probe_all(Fixings& fixings, const Box& box, double cutoff,
                                             double& closed_bound, const Interrupt& interrupt);

  const ScaledProblem& problem_;
  std::unique_ptr<NodeEngine> relaxation_;
  std::vector<PseudoCosts::Gain> probed_;
  std::vector<std::uint8_t> idle_;  // by row, for a round of probing: not tried
  Fixings fixings_;
  std::vector<Index> held_;
  std::vector<Node> closed_;
  Vector contradiction_;  // of the nodes that is_feasible() last refuted
  std::shared_ptr<const LeafMultipliers> contradiction_record_, inherited_;
  bool keep_ = false;
  const Box* record_ = nullptr;
};

}  // namespace marble
