// Branch and bound on the pairs: the global optimum of a convex LCQP, or a bound on it.
//
// A node fixes one side of some pairs at zero and relaxes the others to s, t ≥ 0; its bound is what the
// multipliers of that convex QP prove. No big M, and so no bounds asked of anybody. Nodes are expanded in
// rounds, always as many and in the same order, so that the answer does not depend on who runs them.
#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <unordered_set>
#include <vector>

#include "proof/proof.h"
#include "run/reporter.h"
#include "run/termination.h"
#include "search/incumbent.h"
#include "tree/expansion.h"
#include "tree/kept_tree.h"

namespace marble {

/// What a tree has found out, in the user's units.
struct TreeResult {
  /// How it ended.
  enum class End {
    none,        ///< there was none: `remark` says why
    exhausted,   ///< no node is open: the incumbent is within the tolerance, or the bound says how far it is
                 ///< not
    infeasible,  ///< no node is open, and each contradicts itself
    unbounded,   ///< `ray` says along what
    limit,       ///< nodes are open: `limit` says which
  };
  End end = End::none;
  Status limit = Status::solved;
  std::optional<UnboundedRay> ray;
  bool proved = false;
  double bound = -std::numeric_limits<double>::infinity();
  double gap = std::numeric_limits<double>::infinity();
  std::int64_t nodes = 0, open_nodes = 0, warm_nodes = 0;
  std::string remark;

  /// The gap of another answer than the tree had, and a bound that is not above it.
  void measure(double objective);
  /// The answer is lower than the tree's: one that is feasible to the tolerances only.
  void answer_is(double objective, const Options& options);
};

class Tree {
 public:
  /// Tries answers on `point`, and with the factorizations of the incumbent's engine.
  Tree(const ScaledProblem& problem, const Options& options, BranchPoint& point, Incumbent& incumbent);

  /// What a search may take and leave behind.
  struct Room {
    double most_bytes;  ///< of memory
    double kept_bytes;  ///< what remains of that for the next search: 0 if there is none
    bool from_kept;     ///< whether it begins with what the last one has left
  };
  /// Looks for a better incumbent than the one there is. True if it was replaced.
  using Improve = std::function<bool(Run& run)>;
  /// Searches from the incumbent, if there is one, else from near z. `improve`, if there is one, is called
  /// now and then, as long as it gains or nodes are many.
  [[nodiscard]] TreeResult search(Run& run, ConstVectorRef z, bool known_convex, const Room& room,
                                  Improve improve = {});
  /// What is kept moves on.
  void shift(const Shift& by) { kept_.shift(problem_.layout, by); }
  /// The matrices have new values.
  void forget_matrices();

 private:
  [[nodiscard]] TreeResult explore(Run& run, ConstVectorRef z, bool known_convex, const Room& room);
  [[nodiscard]] std::optional<TreeResult> prepare(Run& run, bool known_convex, const Room& room);
  [[nodiscard]] bool make_expanders(Run& run, std::size_t count,
                                    double most_bytes = std::numeric_limits<double>::infinity());
  [[nodiscard]] Node make_root(ConstVectorRef z);
  [[nodiscard]] std::optional<TreeResult::End> begin(Run& run, Node root, std::vector<Node> leaves,
                                                     const Room& room);
  [[nodiscard]] std::optional<TreeResult::End> begin_at_root(Run& run, Node root);
  [[nodiscard]] bool go_on_from(Run& run, ConstVectorRef from, std::vector<Node> leaves);
  [[nodiscard]] bool still_closed(Node& leaf, ConstVectorRef from, RowProof& proof, bool adapted);
  void settle(const Room& room);
  [[nodiscard]] bool round(Run& run);
  void raise_by_solutions(Node& node, const Fixings& fixings) const;
  void raise(Node& node, const Fixings& fixings, std::initializer_list<const Iterate*> points) const;
  void choose_nodes(std::size_t count);
  void take(Run& run, Expansion& expansion);
  void close(Node node, double bound);
  void keep_leaf(Node leaf);
  void record(const Node& leaf) const;
  void keep(std::vector<Node> leaves);
  void close_all();
  void push(Node node);
  [[nodiscard]] bool try_as_answer(Run& run, const Suggestion& suggestion, const Fixings& fixings,
                                   bool leaf = false);
  void try_to_improve(Run& run);
  [[nodiscard]] double cutoff() const;
  [[nodiscard]] double bound() const;
  [[nodiscard]] double gap(double bound) const;
  [[nodiscard]] TreeResult result(TreeResult::End end) const;
  [[nodiscard]] TreeResult stopped(Run& run) const;
  void report(Run& run);

  const ScaledProblem& problem_;
  const Options& options_;
  BranchPoint& point_;
  Incumbent& incumbent_;
  Reporter reporter_;
  std::unique_ptr<Gram> gram_;
  std::vector<std::unique_ptr<Expander>> expanders_;
  std::optional<Box> box_;
  double radius_ = 0.0;
  Vector from_;  // where it begins
  NodeEngine::Center center_;
  PseudoCosts costs_;
  std::vector<Clause> clauses_;
  std::vector<Node> open_;  // a heap: the least bound first
  std::vector<Expansion> expansions_;
  std::size_t chosen_ = 0;
  double closed_bound_ = 0.0, told_bound_ = 0.0;
  std::int64_t nodes_ = 0, made_ = 0, rounds_ = 0, warm_nodes_ = 0, warm_closed_ = 0;
  Improve improve_;
  std::int64_t until_improving_ = 0, between_improving_ = 0;  // rounds
  double most_nodes_ = 0.0;
  bool engine_fits_ = true;  // the last one that was to be made: within its memory
  KeptTree kept_;
  bool keeps_ = false;
  marble::Proof* proof_ = nullptr;  // what is to be recorded in
  std::optional<bool> convex_;
  std::unordered_set<std::size_t> tried_;  // branches, by their hash
  std::optional<UnboundedRay> ray_;
};

}  // namespace marble
