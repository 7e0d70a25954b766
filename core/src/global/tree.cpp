#include "global/tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool is_after(const Node& a, const Node& b) {
  if (a.bound != b.bound) return a.bound > b.bound;
  if (a.bound == -kInfinity && a.depth != b.depth) return a.depth < b.depth;  // to where it may be unbounded
  return a.number > b.number;
}

TreeResult none(std::string why) {
  TreeResult result;
  result.remark = std::move(why);
  return result;
}

std::size_t branch_hash(const WorkingSet& set) {
  std::size_t hash = 0;
  for (Index pair = 0; pair < set.layout.pairs; ++pair) hash = 31 * hash + (set.s_fixed[pair] != 0 ? 1 : 2);
  return hash;
}

}  // namespace

Tree::Tree(const ScaledProblem& problem, const Options& options, BranchPoint& point, Incumbent& incumbent)
    : problem_(problem),
      options_(options),
      point_(point),
      incumbent_(incumbent),
      reporter_(problem),
      costs_(problem.pairs()),
      expansions_(tuning::tree_round) {}

TreeResult Tree::search(Run& run, ConstVectorRef z, bool known_convex, const Room& room, Improve improve) {
  const PhaseScope phase(run.activity(), Phase::tree);
  const Run::Polishing polishing(run, &Times::tree_s);
  improve_ = std::move(improve);
  until_improving_ = between_improving_ = tuning::tree_rounds_between;
  TreeResult result = explore(run, z, known_convex, room);
  settle(room);
  improve_ = {};
  return result;
}

TreeResult Tree::explore(Run& run, ConstVectorRef z, bool known_convex, const Room& room) {
  proof_ = run.proof();
  if (proof_ != nullptr) clear_leaves(*proof_);
  const bool convex = known_convex || convex_.value_or(false);
  if (!convex) {
    if (auto ended = prepare(run, false, room)) return *std::move(ended);
  }
  keeps_ = room.kept_bytes > 0.0 || proof_ != nullptr;
  tried_.clear();
  clauses_.clear();
  ray_.reset();
  nodes_ = made_ = rounds_ = reused_nodes_ = warm_closed_ = 0;
  closed_bound_ = kInfinity;
  reported_bound_ = -kInfinity;
  std::vector<Node> leaves = kept_.replace(room.kept_bytes);
  Node root = make_root(z);
  if (root.bound >= cutoff()) {  // proved by the incumbent's multipliers, without an engine
    close(root, root.bound);
    return result(TreeResult::End::exhausted);
  }
  if (convex) {
    if (auto ended = prepare(run, true, room)) return *std::move(ended);
  }
  if (!room.from_kept) costs_ = PseudoCosts(problem_.pairs());
  if (!room.from_kept || proof_ != nullptr) leaves.clear();
  if (incumbent_.exists()) tried_.insert(branch_hash(incumbent_.best().set));
  if (const auto end = begin(run, std::move(root), std::move(leaves), room))
    return *end == TreeResult::End::limit ? stopped(run) : result(*end);
  report(run);
  while (!open_.empty() && !ray_) {
    if (open_.front().bound >= cutoff()) close_all();
    if (open_.empty()) break;
    if (run.interrupted() || nodes_ + 2 > options_.node_limit || !round(run)) return stopped(run);
    try_to_improve(run);
    report(run);
  }
  return result(ray_ ? TreeResult::End::unbounded : TreeResult::End::exhausted);
}

// Determines memory and engines. Returns a result if a tree is impossible, or if Q is not convex.
std::optional<TreeResult> Tree::prepare(Run& run, bool known_convex, const Room& room) {
  double numbers =
      room.kept_bytes > 0.0 ? std::min<double>(problem_.variables(), problem_.layout.size()) : 0.0;
  if (proof_ != nullptr) numbers += problem_.variables() + problem_.equalities() + problem_.layout.size();
  const double node = Node::bytes(problem_.layout, numbers);
  const auto too_large = [&] { return none("not proved: a tree needs more memory than there is"); };
  const double bytes = room.most_bytes - room.kept_bytes - Gram::most_bytes(problem_);
  most_nodes_ = bytes / node;
  if (!(most_nodes_ >= tuning::tree_least_nodes)) return too_large();
  if (gram_ == nullptr) gram_ = std::make_unique<Gram>(problem_);
  for (const auto& expander : expanders_) expander->relaxation().attend(run.interrupt());
  const auto not_convex = [&] {
    if (const auto reason = run.interrupted()) {
      TreeResult stopped = none("stopped before the tree had begun");
      stopped.end = TreeResult::End::limit;
      stopped.limit = *reason;
      return stopped;
    }
    return none("not proved: Q is not convex");
  };
  const double engines = run.runner() != nullptr ? tuning::tree_round : 1;
  if (!make_expanders(run, 1, bytes / engines))
    return run.interrupted() || engine_fits_ ? not_convex() : too_large();
  most_nodes_ -= engines * expanders_[0]->relaxation().bytes() / node;
  if (!(most_nodes_ >= tuning::tree_least_nodes)) return too_large();
  if (!convex_ && !known_convex) {
    if (!expanders_[0]->relaxation().is_convex(run)) return not_convex();
    convex_ = true;
  }
  return std::nullopt;
}

// Existing engines have the problem's values and K's factor. Engines for helpers repeat the work of the first
// one, which is counted once, as without helpers.
bool Tree::make_expanders(Run& run, std::size_t count, double most_bytes) {
  while (expanders_.size() < count) {
    KktCost least;
    std::unique_ptr<Kkt> kkt = make_kkt(relaxed(), {most_bytes, kInfinity}, run.interrupt(), least);
    engine_fits_ = kkt != nullptr;
    if (kkt == nullptr) return false;
    auto expander = std::make_unique<Expander>(relaxed(), std::move(kkt), *gram_);
    Run for_helper = run.part(true);
    if (!expander->relaxation().prepare(expanders_.empty() ? run : for_helper)) return false;
    expanders_.push_back(std::move(expander));
  }
  return true;
}

void Tree::forget_matrices() {
  expanders_.clear();
  gram_.reset();
  convex_.reset();
}

// Limits the kept data to their memory: the leaves first, then engines and columns.
void Tree::settle(const Room& room) {
  keep(std::exchange(open_, {}));
  Fixings sides(static_cast<std::size_t>(problem_.pairs()), Sides::t_zero);
  for (Index pair = 0; incumbent_.exists() && pair < problem_.pairs(); ++pair) {
    if (incumbent_.best().set.s_fixed[pair] != 0) sides[static_cast<std::size_t>(pair)] = Sides::s_zero;
  }
  kept_.set_answer(std::move(sides));
  weaken();
  double bytes = kept_.bytes() + (gram_ != nullptr ? gram_->bytes() : 0.0);
  for (const auto& expander : expanders_) bytes += expander->relaxation().bytes();
  if (bytes <= room.kept_bytes) return;
  expanders_.clear();
  gram_.reset();
}

// Raises a bound to what the multipliers of the current exact solutions prove. For the node that such a
// solution solves, this avoids paying again for the stationarity residual that an engine has left.
void Tree::raise_by_solutions(Node& node, const Fixings& fixings) const {
  if (incumbent_.exists()) raise(node, fixings, {&incumbent_.best().x, &incumbent_.other().x});
}

void Tree::raise(Node& node, const Fixings& fixings, std::initializer_list<const Iterate*> points) const {
  DualBound dual_bound(relaxed());
  Vector multipliers;
  const auto fixed = [&](Index row) { return is_fixed(relaxed().layout, fixings, row); };
  for (const Iterate* x : points) {
    take_signs(with_added_rows(-x->lambda()), fixed, multipliers);
    const double bound = dual_bound.of_objective(*box_, x->z(), x->y(), multipliers);
    if (bound <= node.bound) continue;
    node.bound = bound;
    if (keeps_) node.keep(problem_.layout, multipliers, Node::Proof::bound);
    if (proof_ != nullptr)
      node.record =
          std::make_shared<const LeafMultipliers>(LeafMultipliers{false, x->z(), x->y(), multipliers, bound});
  }
}

void Tree::close(Node node, double bound) {
  closed_bound_ = std::min(closed_bound_, bound);
  keep_leaf(std::move(node));
}

void Tree::keep(std::vector<Node> leaves) {
  for (Node& leaf : leaves) keep_leaf(std::move(leaf));
}

void Tree::keep_leaf(Node leaf) {
  if (!keeps_) return;
  if (proof_ != nullptr) record(leaf);
  kept_.add(problem_.layout, std::move(leaf));
}

void Tree::push(Node node) {
  node.number = made_++;
  open_.push_back(std::move(node));
  std::push_heap(open_.begin(), open_.end(), is_after);
}

// No open node can have a better solution.
void Tree::close_all() {
  closed_bound_ = std::min(closed_bound_, open_.front().bound);
  keep(std::exchange(open_, {}));
}

// Chooses the lowest bounds; if memory runs out, or as long as there is no solution, the deepest nodes.
void Tree::choose_nodes(std::size_t count) {
  const bool dive =
      !incumbent_.exists() || static_cast<double>(open_.size()) + 2.0 * tuning::tree_round > most_nodes_;
  const double limit = cutoff();
  chosen_ = 0;
  while (chosen_ < count && !open_.empty()) {
    if (dive) {
      const auto deepest = std::ranges::max_element(open_, [](const Node& a, const Node& b) {
        return a.depth < b.depth || (a.depth == b.depth && is_after(a, b));
      });
      std::iter_swap(deepest, open_.end() - 1);
    } else {
      std::pop_heap(open_.begin(), open_.end(), is_after);
    }
    Node node = std::move(open_.back());
    open_.pop_back();
    if (node.bound >= limit) {
      const double bound = node.bound;
      close(std::move(node), bound);
    } else {
      expansions_[chosen_++].node = std::move(node);
    }
  }
  if (dive) std::make_heap(open_.begin(), open_.end(), is_after);
}

// Returns false if memory or a stop ends the tree.
bool Tree::round(Run& run) {
  if (static_cast<double>(open_.size()) > most_nodes_) return false;
  const std::int64_t left = (options_.node_limit - nodes_) / 2;
  choose_nodes(static_cast<std::size_t>(std::min<std::int64_t>(left, tuning::tree_round)));
  const bool at_once = run.runner() != nullptr && chosen_ > 1;
  if (!make_expanders(run, at_once ? chosen_ : 1)) {
    for (std::size_t i = 0; i < chosen_; ++i) push(std::move(expansions_[i].node));
    return false;
  }
  std::vector<std::function<void()>> tasks;
  const bool suggest = rounds_++ % tuning::tree_rounds_between == 0;
  for (std::size_t i = 0; i < chosen_; ++i) {
    Expansion& expansion = expansions_[i];
    expansion.center = &center_;
    expansion.box = &*box_;
    expansion.costs = &costs_;
    expansion.clauses = &clauses_;
    expansion.most_children = (options_.node_limit - nodes_) / static_cast<std::int64_t>(chosen_);
    expansion.cutoff = cutoff();
    expansion.suggest = suggest && i == 0;
    expansion.keep = keeps_;
    expansion.record = proof_ != nullptr;
    Expander& expander = *expanders_[at_once ? i : 0];
    tasks.emplace_back([&expansion, &expander, &run] { expander.expand(expansion, run.interrupt()); });
  }
  if (at_once) {
    run.runner()->run(tasks);
  } else {
    for (const auto& task : tasks) task();
  }
  for (std::size_t i = 0; i < chosen_; ++i) take(run, expansions_[i]);
  return true;
}

void Tree::take(Run& run, Expansion& e) {
  using Outcome = Expansion::Outcome;
  if (e.outcome != Outcome::interrupted) {
    closed_bound_ = std::min(closed_bound_, e.closed_bound);
    nodes_ += e.bounded;
    keep(std::move(e.closed));
  }
  run.factorizations += static_cast<std::int32_t>(e.factorizations);
  for (const PseudoCosts::Gain& gain : e.gains) costs_.add(gain);
  if (e.suggestion) {
    Fixings fixings;
    std::vector<Index> held;
    e.node.read(relaxed().layout, fixings, held);
    const bool leaf = e.outcome == Outcome::leaf;
    const bool solved = try_as_answer(run, *e.suggestion, fixings, leaf);
    if (leaf && solved && point_.sharpen()) raise(e.node, fixings, {&point_.x});
    if (leaf && !solved && !ray_) {
      if (std::optional<LeafMultipliers> proof = branch_contradiction(problem_, point_.set, run)) {
        e.node.bound = kInfinity;
        if (proof_ != nullptr) e.node.record = std::make_shared<const LeafMultipliers>(*std::move(proof));
      }
    }
    if (leaf || e.outcome == Outcome::complementary) raise_by_solutions(e.node, fixings);
  }
  switch (e.outcome) {
    case Outcome::branched:
      for (Node& child : e.children) push(std::move(child));
      break;
    case Outcome::closed:
      break;
    case Outcome::leaf:
      // Nothing is left to branch on: its suggestion is its solution, or could not be solved.
      close(e.node, e.node.bound);
      break;
    case Outcome::complementary:
      e.node.exhausted = true;
      push(std::move(e.node));
      break;
    case Outcome::interrupted:
      push(std::move(e.node));
      break;
  }
}

// Counted in rounds, so that helpers change nothing. After a gain it is repeated soon, otherwise after twice
// as many rounds as before.
void Tree::try_to_improve(Run& run) {
  if (!improve_ || !incumbent_.exists() || open_.empty() || run.interrupted() || --until_improving_ > 0)
    return;
  if (improve_(run)) {
    tried_.insert(branch_hash(incumbent_.best().set));
    between_improving_ = tuning::tree_rounds_between;
  } else {
    between_improving_ *= 2;
  }
  until_improving_ = between_improving_;
}

// Solves the branch of the fixed sides and of the smaller sides of the other pairs exactly or, if it has no
// solution, tries to prove it unbounded. Returns true if it has a solution, which is then in point_.
bool Tree::try_as_answer(Run& run, const Suggestion& suggestion, const Fixings& fixings, bool leaf) {
  Iterate x(problem_);
  x.z() = suggestion.z;
  x.y() = suggestion.y;
  x.lambda() = -without_added_rows(suggestion.multipliers);
  Images images(problem_);
  images.evaluate(problem_, x);
  WorkingSet set(problem_);
  std::ranges::fill(set.held, std::uint8_t{0});
  const Index added = relaxed().inequalities() - problem_.inequalities();
  for (const Index row : suggestion.held) {
    if (row < problem_.inequalities()) set.held[row] = 1;
    if (row >= relaxed().inequalities()) set.held[row - added] = 1;
  }
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const Sides fixed = fixings[static_cast<std::size_t>(pair)];
    const bool open = fixed == Sides::relaxed || fixed == Sides::both_zero;
    const bool s = open ? images.rows.s()[pair] < images.rows.t()[pair] : has_s(fixed);
    const Index free = s ? problem_.layout.t(pair) : problem_.layout.s(pair);
    set.fix(pair, s, set.held[free] != 0);
  }
  if (!tried_.insert(branch_hash(set)).second && !leaf) return false;
  point_.restore(x, set);
  auto outcome = incumbent_.solve_branch(run, "tree", tuning::engine_budget);
  if (leaf && outcome == Incumbent::Outcome::not_exact) {  // the point of a relaxation may be far out
    Iterate near(problem_);
    near.z() = from_;
    point_.restore(near, set);
    outcome = incumbent_.solve_branch(run, "tree", tuning::engine_budget);
  }
  if (outcome != Incumbent::Outcome::not_exact) return true;
  ray_ = prove_branch_unbounded(problem_, options_, set, run);
  if (!ray_ && !incumbent_.exists()) incumbent_.offer(x, images, set, "tree");
  return false;
}

}  // namespace marble
