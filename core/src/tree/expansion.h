// One node's work: its relaxation is solved again from the rows its parent held, a pair is chosen, and both
// children are bounded. Expansions of one round know nothing of each other, so that they may run at once.
#pragma once

#include <optional>

#include "relaxation/relaxation.h"
#include "tree/clauses.h"
#include "tree/node.h"
#include "tree/pseudo_costs.h"

namespace marble {

/// What a node's relaxation suggests as an answer: a branch, by the smaller sides, and where to start on it.
struct Suggestion {
  Vector z, y, multipliers;
  std::vector<Index> held;
};

struct Expansion {
  /// What it is about: set by the tree.
  Node node;
  const NodeEngine::Center* center = nullptr;
  const Box* box = nullptr;
  const PseudoCosts* costs = nullptr;
  const std::vector<Clause>* clauses = nullptr;
  std::int64_t most_children = 2;
  double cutoff = 0.0;   ///< scaled objective: what is not below it is closed
  bool suggest = false;  ///< whether its point is to be tried even if it is not complementary
  bool keep = false;     ///< whether nodes keep their multipliers, and what is closed is told
  bool record = false;   ///< whether they keep all of their proofs

  /// What has come of it.
  enum class Outcome {
    branched,       ///< children, of which some may be closed
    closed,         ///< by its own bound, or infeasible
    complementary,  ///< its point is a suggestion that may end it
    leaf,           ///< no pair is left to branch on
    interrupted,    ///< as if it had not been begun
  };
  Outcome outcome = Outcome::interrupted;
  double closed_bound = 0.0;  ///< the least of what was closed; +∞ if nothing or infeasible
  std::vector<Node> children, closed;
  int bounded = 0;  ///< children whose bound was found
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

  /// Of what the relaxation has solved.
  [[nodiscard]] Suggestion suggestion() const;
  /// Fixes sides that both children of no pair can do without: of each pair whose one side cannot be zero
  /// below the cutoff, the other one. False where neither can: nothing is left. Rounds of it, as long as they
  /// fix enough.
  [[nodiscard]] bool probe(Fixings& fixings, const Box& box, double cutoff, double& closed_bound,
                           const Interrupt& interrupt);
  /// What probe() has learned of each side that it could not fix.
  [[nodiscard]] const std::vector<PseudoCosts::Gain>& probed() const { return probed_; }
  /// Nodes that probe() or the last expansion have closed, with what proves it.
  [[nodiscard]] std::vector<Node> take_closed() { return std::exchange(closed_, {}); }
  /// From now on nodes keep their multipliers and, where there is a box to bound them in, all of their
  /// proofs: what `inherited` proves of all that is solved until the next call, or their own.
  void keep(bool keep, const Box* record, std::shared_ptr<const LeafMultipliers> inherited) {
    keep_ = keep;
    record_ = record;
    relaxation_->keep_best(record != nullptr);
    inherited_ = std::move(inherited);
  }
  /// A node of what was solved last.
  [[nodiscard]] Node node(const Fixings& fixings, NodeEngine::End end) const;
  /// Clauses among the pairs that are not fixed, by what probe() has learned, each of pairs of its own.
  [[nodiscard]] std::vector<Clause> find_clauses(const Fixings& fixings, const NodeEngine::Center& center,
                                                 const Box& box, const Interrupt& interrupt);

 private:
  struct Choice {
    Index pair = -1;
    double gain = 0.0;  // of the lesser side
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
  std::vector<std::uint8_t> idle_;  // by row, of a round of probing: not to be tried
  Fixings fixings_;
  std::vector<Index> held_;
  std::vector<Node> closed_;
  Vector contradiction_;  // of what is_feasible() last refuted
  std::shared_ptr<const LeafMultipliers> contradiction_record_, inherited_;
  bool keep_ = false;
  const Box* record_ = nullptr;
};

}  // namespace marble
