// How a tree begins: at its root, whose relaxation may need rows that pairs imply, or from kept leaves.
#include <algorithm>
#include <limits>
#include <utility>

#include "global/tree.h"
#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

// Makes the root around the incumbent, or around z, and bounds it with what is available without an engine.
Node Tree::make_root(ConstVectorRef z) {
  from_ = incumbent_.exists() ? Vector(incumbent_.best().x.z()) : Vector(z);
  radius_ = reach_from(problem_, from_);
  box_.emplace(problem_, radius_);
  ++nodes_;
  const Fixings none(static_cast<std::size_t>(problem_.pairs()));
  Node root(problem_.layout, none, {});
  root.bound = -kInfinity;
  raise_by_solutions(root, none);
  return root;
}

// Begins from the kept leaves, or from the root. Returns a result if that is already the end.
std::optional<TreeResult::End> Tree::begin(Run& run, Node root, std::vector<Node> leaves, const Room& room) {
  expanders_[0]->keep(keeps_, proof_ != nullptr ? &*box_ : nullptr, root.record);
  if (!expanders_[0]->relaxation().start(from_)) {
    push(std::move(root));
    return TreeResult::End::limit;
  }
  if (!leaves.empty()) {
    if (go_on_from(run, from_, std::move(leaves))) return std::nullopt;
    reused_nodes_ = 0;
    closed_bound_ = kInfinity;
    static_cast<void>(kept_.replace(room.kept_bytes));
  }
  std::int64_t counted = expanders_[0]->relaxation().factorizations();
  const auto count = [&] {
    run.factorizations += static_cast<std::int32_t>(expanders_[0]->relaxation().factorizations() - counted);
  };
  NodeEngine::End solved = expanders_[0]->relaxation().solve(*box_, cutoff(), run.interrupt());
  if (solved != NodeEngine::End::infeasible && solved != NodeEngine::End::interrupted &&
      std::max(root.bound, expanders_[0]->relaxation().bound()) < -tuning::runaway) {
    count();
    const Strength strength = strengthen(run);
    counted = expanders_.empty() ? 0 : expanders_[0]->relaxation().factorizations();
    if (strength == Strength::infeasible) return TreeResult::End::infeasible;
    if (strength == Strength::gained) solved = solve_strengthened(run);
    if (strength == Strength::stopped) solved = NodeEngine::End::interrupted;
  }
  const auto end = begin_at_root(run, std::move(root), solved);
  if (!expanders_.empty()) count();
  return end;
}

// The sides that cannot be positive are zero from the beginning.
NodeEngine::End Tree::solve_strengthened(Run& run) {
  NodeEngine& relaxation = expanders_[0]->relaxation();
  if (!relaxation.start(from_)) return NodeEngine::End::interrupted;
  const RowLayout& rows = relaxed().layout;
  for (Index pair = 0; pair < rows.pairs; ++pair) {
    if (has_s(implied_->bounds().sides[pair])) relaxation.fix(rows.s(pair));
    if (has_t(implied_->bounds().sides[pair])) relaxation.fix(rows.t(pair));
  }
  return relaxation.solve(*box_, cutoff(), run.interrupt());
}

// Goes on from the solved relaxation of the root. With an incumbent, probing comes first and fixes sides for
// good.
std::optional<TreeResult::End> Tree::begin_at_root(Run& run, Node root, NodeEngine::End end) {
  using End = NodeEngine::End;
  const double by_incumbent = root.bound;
  if (end == End::interrupted) {
    push(std::move(root));
    return TreeResult::End::limit;
  }
  Expander& expander = *expanders_[0];
  NodeEngine& relaxation = expander.relaxation();
  Fixings fixings =
      strengthened_ ? implied_->bounds().sides : Fixings(static_cast<std::size_t>(problem_.pairs()));
  if (end == End::infeasible || end == End::cutoff) {
    close(expander.node(fixings, end), end == End::cutoff ? relaxation.bound() : kInfinity);
    return end == End::cutoff ? TreeResult::End::exhausted : TreeResult::End::infeasible;
  }
  std::optional<Suggestion> suggestion;
  if (end == End::optimal) suggestion = expander.suggestion();
  center_ = relaxation.center();
  const bool fixable = incumbent_.exists();
  if (suggestion && !fixable) static_cast<void>(try_as_answer(run, *suggestion, fixings));
  const bool left = !fixable || expander.probe(fixings, *box_, cutoff(), closed_bound_, run.interrupt());
  keep(expander.take_closed());
  if (!left) return TreeResult::End::exhausted;
  if (suggestion && fixable) static_cast<void>(try_as_answer(run, *suggestion, fixings));
  for (const PseudoCosts::Gain& gain : expander.probed()) costs_.add(gain);
  root = expander.node(fixings, end);
  root.bound = std::max(by_incumbent, relaxation.bound());
  push(std::move(root));
  if (fixable) clauses_ = expander.find_clauses(fixings, center_, *box_, run.interrupt());
  return std::nullopt;
}

// Adds rows that pairs and rows imply together. Called where the relaxation of the root has no bound worth
// the name: what nothing bounds ends at rounding times the radius, not always at −∞.
Tree::Strength Tree::strengthen(Run& run) {
  if (proof_ != nullptr || !ImpliedBounds::is_affordable(problem_)) return Strength::none;
  implied_.emplace(problem_, options_);
  const ImpliedBounds::End end = implied_->probe(run.interrupt());
  if (end == ImpliedBounds::End::infeasible) return Strength::infeasible;
  if (end == ImpliedBounds::End::stopped) return Strength::stopped;
  ScaledProblem stronger = implied_->strengthened();
  if (stronger.inequalities() == problem_.inequalities()) return Strength::none;
  expanders_.clear();
  strengthened_ = std::move(stronger);
  gram_ = std::make_unique<Gram>(*strengthened_);
  box_.emplace(*strengthened_, radius_);
  box_->intersect(implied_->bounds().lower, implied_->bounds().upper);
  keeps_ = false;
  return make_expanders(run, 1) ? Strength::gained : Strength::stopped;
}

void Tree::weaken() {
  if (!strengthened_) return;
  expanders_.clear();
  gram_.reset();
  strengthened_.reset();
}

// Multipliers of the problem's rows, with zeros for those that were added.
Vector Tree::with_added_rows(ConstVectorRef rows) const {
  const Index own = problem_.inequalities(), sides = 2 * problem_.pairs();
  Vector all = Vector::Zero(relaxed().layout.size());
  all.head(own) = rows.head(own);
  all.tail(sides) = rows.tail(sides);
  return all;
}

Vector Tree::without_added_rows(ConstVectorRef rows) const {
  const Index own = problem_.inequalities(), sides = 2 * problem_.pairs();
  Vector some(own + sides);
  some.head(own) = rows.head(own);
  some.tail(sides) = rows.tail(sides);
  return some;
}

// Continues from the leaves of the last tree, with what their multipliers prove for the current numbers.
// Returns false if that is too little: beginning at the root is then as good.
bool Tree::go_on_from(Run& run, ConstVectorRef from, std::vector<Node> leaves) {
  NodeEngine& engine = expanders_[0]->relaxation();
  center_ = engine.center();
  ProximalSystem* const system = engine.proximal_system(run);
  if (system == nullptr) return false;
  RowProof proof(problem_, *system);
  reused_nodes_ = static_cast<std::int64_t>(leaves.size());
  for (Node& leaf : leaves) {
    leaf.bound = -kInfinity;
    leaf.exhausted = false;
  }
  const auto close_some = [&](bool adapted) {
    std::erase_if(leaves, [&](Node& leaf) {
      if (run.interrupted() || !still_closed(leaf, from, proof, adapted)) return false;
      close(leaf, leaf.bound);
      ++warm_closed_;
      return true;
    });
  };
  close_some(false);
  if (!leaves.empty()) {
    close_some(true);
    run.factorizations += static_cast<std::int32_t>(proof.factorizations());
    if (!engine.prepare(run)) return false;
  }
  if (static_cast<double>(warm_closed_) < tuning::tree_still_closed * static_cast<double>(reused_nodes_))
    return false;
  for (Node& leaf : leaves) push(std::move(leaf));
  return true;
}

// Closes a leaf by its own multipliers, unchanged or adapted to the current numbers, or by those of the
// current solutions.
bool Tree::still_closed(Node& leaf, ConstVectorRef from, RowProof& proof, bool adapted) {
  Fixings fixings;
  std::vector<Index> held;
  Vector multipliers;
  leaf.read(problem_.layout, fixings, held);
  const auto fixed = [&](Index row) { return is_fixed(problem_.layout, fixings, row); };
  take_signs(leaf.multipliers(problem_.layout), fixed, multipliers);
  if (!adapted) {
    if (leaf.proof == Node::Proof::contradiction && proof.contradicts(*box_, multipliers)) {
      leaf.bound = kInfinity;
    } else if (leaf.proof == Node::Proof::bound) {
      leaf.bound = proof.bound(*box_, from, multipliers, cutoff());
    }
    if (leaf.bound < cutoff()) raise_by_solutions(leaf, fixings);
  } else if (leaf.proof == Node::Proof::bound) {
    leaf.bound = std::max(leaf.bound, proof.adapt(*box_, from, fixed, multipliers, cutoff()));
    leaf.keep(problem_.layout, multipliers, Node::Proof::bound);
  }
  return leaf.bound >= cutoff();
}

}  // namespace marble
