#include "tree/tree.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool is_after(const Node& a, const Node& b) {
  return a.bound > b.bound || (a.bound == b.bound && a.number > b.number);
}

TreeResult none(std::string why) {
  TreeResult result;
  result.remark = std::move(why);
  return result;
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

TreeResult Tree::search(Run& run, ConstVectorRef z, bool known_convex, double most_bytes) {
  const Run::Polishing polishing(run);
  const double bytes = Gram::most_bytes(problem_);
  most_nodes_ = (most_bytes - bytes) / Node::bytes(problem_.layout);
  if (!(most_nodes_ >= tuning::tree_least_nodes))
    return none("not proved: a tree needs more memory than there is");
  gram_ = std::make_unique<Gram>(problem_);
  expanders_.clear();
  if (!make_expanders(run, 1)) {
    if (const auto reason = run.interrupted()) {
      TreeResult stopped = none("stopped before the tree had begun");
      stopped.end = TreeResult::End::limit;
      stopped.limit = *reason;
      return stopped;
    }
    return none("not proved: Q is not convex");
  }
  const double engines = run.runner() != nullptr ? tuning::tree_round : 1;
  most_nodes_ -= engines * expanders_[0]->relaxation().bytes() / Node::bytes(problem_.layout);
  if (!known_convex && !expanders_[0]->relaxation().is_convex(run))
    return none("not proved: Q is not convex");
  open_.clear();
  tried_.clear();
  costs_ = PseudoCosts(problem_.pairs());
  nodes_ = made_ = rounds_ = 0;
  undecided_ = false;
  closed_bound_ = kInfinity;
  told_bound_ = -kInfinity;
  if (const auto end = begin(run, z)) return *end == TreeResult::End::limit ? stopped(run) : result(*end);
  report(run);
  while (!open_.empty()) {
    if (open_.front().bound >= cutoff()) close_all();
    if (open_.empty()) break;
    if (run.interrupted() || nodes_ + 2 > options_.node_limit || !round(run)) return stopped(run);
    report(run);
  }
  return result(TreeResult::End::exhausted);
}

// Those there are have the problem's values and K's factor.
bool Tree::make_expanders(Run& run, std::size_t count) {
  while (expanders_.size() < count) {
    std::unique_ptr<Kkt> kkt = make_kkt(problem_, run.interrupt());
    if (kkt == nullptr) return false;
    expanders_.push_back(std::make_unique<Expander>(problem_, std::move(kkt), *gram_));
    if (!expanders_.back()->relaxation().prepare(run)) return false;
  }
  return true;
}

// The root; where there is an incumbent, what it fixes for good. An end, if that is all.
std::optional<TreeResult::End> Tree::begin(Run& run, ConstVectorRef z) {
  const Vector& from = incumbent_.exists() ? Vector(incumbent_.best().x.z()) : Vector(z);
  radius_ = tuning::tree_radius * (1.0 + max_abs(from.cwiseProduct(problem_.variable_scale)));
  box_.emplace(problem_, radius_);
  Fixings fixings(static_cast<std::size_t>(problem_.pairs()));
  const double by_incumbent = bound_by_solutions(fixings);
  if (by_incumbent >= cutoff()) {
    ++nodes_;
    close(by_incumbent);
    return TreeResult::End::exhausted;
  }
  NodeEngine& relaxation = expanders_[0]->relaxation();
  if (!relaxation.start(from)) return TreeResult::End::limit;
  Node root(problem_.layout, fixings, {});
  root.bound = -kInfinity;
  using End = NodeEngine::End;
  const End end = relaxation.solve(*box_, cutoff(), run.interrupt());
  if (end == End::interrupted) {
    push(std::move(root));
    return TreeResult::End::limit;
  }
  ++nodes_;
  if (end == End::infeasible) return TreeResult::End::infeasible;
  if (end == End::cutoff) {
    close(relaxation.bound());
    return TreeResult::End::exhausted;
  }
  if (end == End::optimal) try_as_answer(run, expanders_[0]->suggestion());
  center_ = relaxation.center();
  if (incumbent_.exists() && !expanders_[0]->probe(fixings, *box_, cutoff(), closed_bound_, run.interrupt()))
    return TreeResult::End::exhausted;
  for (const PseudoCosts::Gain& gain : expanders_[0]->probed()) costs_.add(gain);
  root = Node(problem_.layout, fixings, relaxation.held());
  root.bound = std::max(by_incumbent, relaxation.bound());
  push(std::move(root));
  clauses_ = incumbent_.exists() ? expanders_[0]->find_clauses(fixings, center_, *box_, run.interrupt())
                                 : std::vector<Clause>();
  run.factorizations += static_cast<std::int32_t>(relaxation.factorizations());
  return std::nullopt;
}

// What the multipliers of the exact solutions at hand prove of a relaxation: of the one that a solution is
// the answer to, all; what an engine has left of stationarity there is not paid for again.
double Tree::bound_by_solutions(const Fixings& fixings) const {
  if (!incumbent_.exists()) return -kInfinity;
  DualBound dual_bound(problem_);
  double best = -kInfinity;
  for (const Iterate* x : {&incumbent_.best().x, &incumbent_.other().x}) {
    Vector multipliers = (-x->lambda()).cwiseMax(0.0);
    for (Index pair = 0; pair < problem_.pairs(); ++pair) {
      const auto sides = static_cast<unsigned>(fixings[static_cast<std::size_t>(pair)]);
      for (const bool s : {true, false}) {
        const Index row = s ? problem_.layout.s(pair) : problem_.layout.t(pair);
        const auto fixed = static_cast<unsigned>(s ? Sides::s_zero : Sides::t_zero);
        if ((sides & fixed) != 0) multipliers[row] = -x->lambda()[row];
      }
    }
    best = std::max(best, dual_bound.of_objective(*box_, x->z(), x->y(), multipliers));
  }
  return best;
}

void Tree::push(Node node) {
  node.number = made_++;
  open_.push_back(std::move(node));
  std::push_heap(open_.begin(), open_.end(), is_after);
}

// No open node can have a better answer.
void Tree::close_all() {
  close(open_.front().bound);
  open_.clear();
}

// The least bounds; where room runs out, or as long as there is no answer, the deepest nodes.
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
      close(node.bound);
    } else {
      expansions_[chosen_++].node = std::move(node);
    }
  }
  if (dive) std::make_heap(open_.begin(), open_.end(), is_after);
}

// False if memory or a stop ends the tree.
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
  const bool suggest = rounds_++ % tuning::tree_rounds_between_answers == 0;
  for (std::size_t i = 0; i < chosen_; ++i) {
    Expansion& expansion = expansions_[i];
    expansion.center = &center_;
    expansion.box = &*box_;
    expansion.costs = &costs_;
    expansion.clauses = &clauses_;
    expansion.most_children = (options_.node_limit - nodes_) / static_cast<std::int64_t>(chosen_);
    expansion.cutoff = cutoff();
    expansion.suggest = suggest && i == 0;
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
    close(e.closed_bound);
    nodes_ += e.bounded;
  }
  run.factorizations += static_cast<std::int32_t>(e.factorizations);
  for (const PseudoCosts::Gain& gain : e.gains) costs_.add(gain);
  if (e.suggestion) try_as_answer(run, *e.suggestion);
  if (e.outcome == Outcome::leaf || e.outcome == Outcome::complementary) {
    Fixings fixings(static_cast<std::size_t>(problem_.pairs()));
    std::vector<Index> held;
    e.node.read(problem_.layout, fixings, held);
    e.node.bound = std::max(e.node.bound, bound_by_solutions(fixings));
  }
  switch (e.outcome) {
    case Outcome::branched:
      for (Node& child : e.children) push(std::move(child));
      break;
    case Outcome::closed:
      break;
    case Outcome::leaf:
      // Nothing is left to branch on: the answer it suggests is its own, or could not be had.
      close(e.node.bound);
      undecided_ = undecided_ || e.node.bound < cutoff();
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

// The branch of the smaller sides, solved exactly.
void Tree::try_as_answer(Run& run, const Suggestion& suggestion) {
  Iterate x(problem_);
  x.z() = suggestion.z;
  x.y() = suggestion.y;
  x.lambda() = -suggestion.multipliers;
  Images images(problem_);
  images.evaluate(problem_, x);
  WorkingSet set(problem_);
  std::ranges::fill(set.held, std::uint8_t{0});
  for (const Index row : suggestion.held) set.held[row] = 1;
  std::size_t hash = 0;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const bool s = images.rows.s()[pair] < images.rows.t()[pair];
    const Index free = s ? problem_.layout.t(pair) : problem_.layout.s(pair);
    set.fix(pair, s, set.held[free] != 0);
    hash = 31 * hash + (s ? 1 : 2);
  }
  if (!tried_.insert(hash).second) return;
  point_.restore(x, set);
  const auto outcome = incumbent_.solve_branch(run, "tree", tuning::engine_budget);
  if (outcome == Incumbent::Outcome::not_exact && !incumbent_.exists())
    incumbent_.offer(x, images, set, "tree");
}

// Nodes whose bound is not below this are closed.
double Tree::cutoff() const {
  if (!incumbent_.exists()) return kInfinity;
  const double objective = problem_.user_objective(incumbent_.best().objective);
  const double tolerance = std::max(options_.gap_tolerance, tuning::exactness);
  const double least = objective - tuning::tree_within_gap * tolerance * std::max(1.0, std::abs(objective));
  return (least - problem_.c0) * problem_.cost_scale;
}

// Of all feasible points: open nodes, closed ones and, as these are not below their cutoff, the incumbent. In
// the user's units, where that rounds.
double Tree::bound() const {
  double least = closed_bound_;
  if (!open_.empty()) least = std::min(least, open_.front().bound);
  const double user = least / problem_.cost_scale;
  const double rounded =
      user + problem_.c0 - tuning::bound_roundoff * (std::abs(user) + std::abs(problem_.c0));
  const double objective =
      incumbent_.exists() ? problem_.user_objective(incumbent_.best().objective) : kInfinity;
  return std::min(std::isfinite(least) ? rounded : least, objective);
}

double Tree::gap() const {
  if (!incumbent_.exists()) return kInfinity;
  const double objective = problem_.user_objective(incumbent_.best().objective);
  return std::max(0.0, objective - bound()) / std::max(1.0, std::abs(objective));
}

TreeResult Tree::result(TreeResult::End end) const {
  TreeResult result;
  result.end = end;
  result.bound = bound();
  result.gap = gap();
  result.nodes = nodes_;
  result.open_nodes = static_cast<std::int64_t>(open_.size());
  if (end == TreeResult::End::exhausted && !incumbent_.exists() && closed_bound_ == kInfinity)
    result.end = TreeResult::End::infeasible;
  result.proved = result.end == TreeResult::End::infeasible ||
                  result.gap <= std::max(options_.gap_tolerance, tuning::exactness);
  char text[160];
  std::snprintf(text, sizeof text, "%s by %lld nodes, %lld open, for |z| <= %.1e: bound %.9g, gap %.1e",
                result.proved ? "proved" : "not proved", static_cast<long long>(nodes_),
                static_cast<long long>(result.open_nodes), radius_, result.bound, result.gap);
  result.remark = text;
  return result;
}

TreeResult Tree::stopped(Run& run) const {
  TreeResult result = this->result(TreeResult::End::limit);
  const auto reason = run.interrupted();
  result.limit = reason.value_or(Status::iteration_limit);
  if (!reason)
    result.remark += nodes_ + 2 > options_.node_limit ? "; node_limit" : "; no memory for more nodes";
  return result;
}

void Tree::report(Run& run) {
  told_bound_ = std::max(told_bound_, bound());
  if (run.sink() == nullptr) return;
  Progress row;
  row.step_length = 1.0;
  row.bound = told_bound_;
  row.nodes = nodes_;
  row.open_nodes = static_cast<std::int64_t>(open_.size());
  if (incumbent_.exists()) {
    row.incumbent = problem_.user_objective(incumbent_.best().objective);
    row.gap = std::max(0.0, row.incumbent - row.bound) / std::max(1.0, std::abs(row.incumbent));
  }
  run.told_iteration = -1;
  if (incumbent_.exists()) {
    reporter_.tell(run, incumbent_.best().x.z(), incumbent_.best().objective, incumbent_.best().violations,
                   row);
  } else {
    point_.x.z() = center_.z;
    point_.images.evaluate(problem_, point_.x);
    reporter_.tell(run, center_.z, point_.images.objective, violations(problem_, point_.images), row);
  }
}

}  // namespace marble
