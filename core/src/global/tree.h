// Branch and bound on the pairs: the global optimum of a convex LCQP, or a bound on it.
//
// A node fixes one side of some pairs at zero and relaxes the others to s, t ≥ 0. Its bound is what the
// multipliers of that convex QP prove. There is no big M, so users need not give bounds. Nodes are expanded
// in rounds, always the same number in the same order, so that the solution does not depend on the threads.
#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <unordered_set>
#include <vector>

#include "global/expansion.h"
#include "global/implied_bounds.h"
#include "global/kept_tree.h"
#include "path/reporter.h"
#include "path/termination.h"
#include "proof/proof.h"
#include "search/incumbent.h"

namespace marble {

/// The result of a tree, in the user's units.
struct TreeResult {
  /// How the tree ended.
  enum class End {
    none,        ///< there was no tree: `remark` says why
    exhausted,   ///< no node is open: the incumbent is within the tolerance, or the bound shows how far it is
                 ///< from it
    infeasible,  ///< no node is open, and each contradicts itself
    unbounded,   ///< along `ray`
    limit,       ///< nodes are open: `limit` says which limit was reached
  };
  End end = End::none;
  Status limit = Status::solved;
  std::optional<UnboundedRay> ray;
  bool proved = false;
  double bound = -std::numeric_limits<double>::infinity();
  double gap = std::numeric_limits<double>::infinity();
  std::int64_t nodes = 0, open_nodes = 0, reused_nodes = 0;
  std::string remark;

  /// Copies bound, gap and numbers of nodes to a solution.
  void report(Solution& solution) const;
  /// Sets the gap of a solution other than the tree's, and a bound that is not above its objective.
  void measure(double objective);
  /// Call this if the solution is lower than the tree's because it is feasible to the tolerances only.
  void answer_is(double objective, const Options& options);
};

class Tree {
 public:
  /// Tries solutions on `point`, with the factorizations of the incumbent's engine.
  Tree(const ScaledProblem& problem, const Options& options, BranchPoint& point, Incumbent& incumbent);

  /// Limits of a search's memory and what it keeps.
  struct Room {
    double most_bytes;  ///< memory
    double kept_bytes;  ///< the part of it that remains for the next search: 0 if there is none
    bool from_kept;     ///< whether the search begins with the leaves that the last one kept
  };
  /// Searches for an incumbent better than the current one. Returns true if it was replaced.
  using Improve = std::function<bool(Run& run)>;
  /// Searches from the incumbent, or from near z if there is none. `improve`, if given, is called now and
  /// then, as long as it gains or there are many nodes.
  [[nodiscard]] TreeResult search(Run& run, ConstVectorRef z, bool known_convex, const Room& room,
                                  Improve improve = {});
  /// Shifts the kept leaves.
  void shift(const Shift& by) { kept_.shift(problem_.layout, by); }
  /// Call this when the matrices have new values.
  void forget_matrices();

 private:
  [[nodiscard]] TreeResult explore(Run& run, ConstVectorRef z, bool known_convex, const Room& room);
  [[nodiscard]] std::optional<TreeResult> prepare(Run& run, bool known_convex, const Room& room);
  [[nodiscard]] bool make_expanders(Run& run, std::size_t count,
                                    double most_bytes = std::numeric_limits<double>::infinity());
  [[nodiscard]] Node make_root(ConstVectorRef z);
  [[nodiscard]] std::optional<TreeResult::End> begin(Run& run, Node root, std::vector<Node> leaves,
                                                     const Room& room);
  [[nodiscard]] std::optional<TreeResult::End> begin_at_root(Run& run, Node root, NodeEngine::End end);
  [[nodiscard]] NodeEngine::End solve_strengthened(Run& run);
  enum class Strength { none, gained, infeasible, stopped };
  [[nodiscard]] Strength strengthen(Run& run);
  void weaken();
  [[nodiscard]] const ScaledProblem& relaxed() const { return strengthened_ ? *strengthened_ : problem_; }
  [[nodiscard]] Vector with_added_rows(ConstVectorRef rows) const;
  [[nodiscard]] Vector without_added_rows(ConstVectorRef rows) const;
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
  std::optional<ImpliedBounds> implied_;
  std::optional<ScaledProblem> strengthened_;  // with rows that bound the relaxations
  std::unique_ptr<Gram> gram_;                 // of relaxed()
  std::vector<std::unique_ptr<Expander>> expanders_;
  std::optional<Box> box_;
  double radius_ = 0.0;
  Vector from_;  // the starting point
  NodeEngine::Center center_;
  PseudoCosts costs_;
  std::vector<Clause> clauses_;
  std::vector<Node> open_;  // a heap: the lowest bound first
  std::vector<Expansion> expansions_;
  std::size_t chosen_ = 0;
  double closed_bound_ = 0.0, reported_bound_ = 0.0;
  std::int64_t nodes_ = 0, made_ = 0, rounds_ = 0, reused_nodes_ = 0, warm_closed_ = 0;
  Improve improve_;
  std::int64_t until_improving_ = 0, between_improving_ = 0;  // in rounds
  double most_nodes_ = 0.0;
  bool engine_fits_ = true;  // whether the last engine fitted into its memory
  KeptTree kept_;
  bool keeps_ = false;
  marble::Proof* proof_ = nullptr;  // where proofs are recorded
  std::optional<bool> convex_;
  std::unordered_set<std::size_t> tried_;  // branches, by their hash
  std::optional<UnboundedRay> ray_;
};

}  // namespace marble
