#include "global/set_tree.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"

namespace marble {
namespace {

constexpr Index opposite(Index side) { return side ^ 1; }

bool contains(const std::vector<Index>& sides, Index side) { return std::ranges::binary_search(sides, side); }

double node_bytes(const Projection::State& state) {
  const auto held = static_cast<double>(state.held.size());
  return sizeof(double) * (5.0 * static_cast<double>(state.v.size()) + held * held);
}

}  // namespace

SetTree::SetTree(const ScaledProblem& problem) : problem_(problem) {}

bool SetTree::applies(const Run& run) const {
  return problem_.pairs() > 2 && problem_.pairs() <= tuning::conflict_depth &&
         Projection::most_bytes(problem_) <= std::min(tuning::set_bytes, run.bytes_left);
}

Index SetTree::row_of(Index side) const {
  return side % 2 == 0 ? problem_.layout.s(side / 2) : problem_.layout.t(side / 2);
}

void SetTree::fix(Index side) { projection_->fix(row_of(side)); }

bool SetTree::is_over() { return nodes_ >= most_nodes_ || run_->interrupted().has_value(); }

const SetTree::Nogood* SetTree::known() const {
  const auto found =
      std::ranges::find_if(nogoods_, [this](const Nogood& nogood) { return are_zero(nogood.sides, zero_); });
  return found == nogoods_.end() ? nullptr : &*found;
}

void SetTree::learn(const Nogood& nogood) {
  for (const Index side : nogood.sides) weight_[static_cast<std::size_t>(side / 2)] += 1.0;
  if (nogoods_.size() < tuning::conflict_nogoods && memory_.may_keep(nogood.sides.size()))
    nogoods_.push_back(nogood);
}

// What the projection's last contradiction needs.
SetTree::Nogood SetTree::learn_contradiction() {
  Nogood nogood;
  for (const Index row : projection_->needed())
    nogood.sides.push_back(2 * problem_.layout.pair_of(row) + (problem_.layout.is_s(row) ? 0 : 1));
  std::ranges::sort(nogood.sides);
  if (run_->proof() != nullptr) {
    ProofLeaf leaf = leaf_of(problem_, projection_->contradiction());
    reason_bytes_ += bytes_of(leaf);
    if (reason_bytes_ <= run_->proof()->most_bytes)
      nogood.reason = std::make_shared<const Reason>(Reason{std::move(leaf), {}});
  }
  learn(nogood);
  return nogood;
}

// Of all s at zero, then of all t, each pair in one clause at most. False if interrupted.
bool SetTree::find_clauses() {
  Projection::State root;
  projection_->save(root);
  std::vector<std::uint8_t> used(static_cast<std::size_t>(problem_.pairs()), 0);
  for (const Index weak : {0, 1}) {
    while (true) {
      projection_->restore(root);
      projection_->ignore_inequalities();
      for (Index pair = 0; pair < problem_.pairs(); ++pair) {
        if (used[static_cast<std::size_t>(pair)] == 0) fix(2 * pair + weak);
      }
      const Projection::End end = projection_->solve();
      ++nodes_;
      if (end == Projection::End::interrupted || is_over()) return false;
      if (end != Projection::End::contradiction) break;
      const Nogood nogood = learn_contradiction();
      if (nogood.sides.empty()) break;  // the root itself: rounding
      for (const Index side : nogood.sides) used[static_cast<std::size_t>(side / 2)] = 1;
      clauses_.push_back({nogood.sides, nogood.reason});
    }
  }
  projection_->restore(root);
  return true;
}

// The open clause with the fewest members that no nogood ends.
std::optional<SetTree::Fork> SetTree::choose_clause() {
  std::optional<Fork> best;
  std::size_t fewest = 0;
  for (const Clause& clause : clauses_) {
    Fork fork{{}, {{}, clause.reason}};
    bool open = true;
    std::size_t alive = 0;
    for (const Index weak : clause.weak) {
      std::uint8_t& zero = zero_of(weak);
      if (zero == opposite(weak) % 2 + 1) {
        open = false;
        break;
      }
      if (zero != 0) {
        fork.rest.sides.push_back(weak);
        continue;
      }
      zero = static_cast<std::uint8_t>(opposite(weak) % 2 + 1);
      if (known() == nullptr) ++alive;
      zero = 0;
      fork.sides.push_back(opposite(weak));
    }
    if (!open || (best && alive >= fewest)) continue;
    fewest = alive;
    best = std::move(fork);
  }
  if (best) {
    const Vector& value = projection_->slacks();
    std::ranges::stable_sort(best->sides, {}, [&](Index side) { return value[row_of(side)]; });
  }
  return best;
}

// All open pairs at their smaller sides: whether that is accepted. Else the pair to fork at: one that the
// contradiction of it needs.
bool SetTree::try_smaller_sides(Index& pair) {
  Projection::State node;
  projection_->save(node);
  const Vector value = projection_->slacks();
  std::vector<std::uint8_t> before = zero_;
  pair = -1;
  double worst = -1.0;
  for (Index k = 0; k < problem_.pairs(); ++k) {
    const double s = value[problem_.layout.s(k)], t = value[problem_.layout.t(k)];
    if (zero_[static_cast<std::size_t>(k)] != 0) continue;
    const Index side = s < t ? 2 * k : 2 * k + 1;
    fix(side);
    zero_of(side) = static_cast<std::uint8_t>(side % 2 + 1);
    const double apart = weight_[static_cast<std::size_t>(k)] * std::max(0.0, std::min(s, t));
    if (apart > worst) worst = apart, pair = k;
  }
  const Projection::End end = projection_->solve();
  ++nodes_;
  if (end == Projection::End::point || end == Projection::End::undecided) {
    WorkingSet branch(problem_);
    for (const Index row : projection_->held()) branch.held[row] = 1;
    for (Index k = 0; k < problem_.pairs(); ++k) {
      const bool s = zero_[static_cast<std::size_t>(k)] == 1;
      const Index free = s ? problem_.layout.t(k) : problem_.layout.s(k);
      branch.fix(k, s, branch.held[free] != 0);
    }
    found_ = (*accept_)(projection_->z(), branch);
  } else if (end == Projection::End::contradiction) {
    double most = -1.0;
    for (const Index side : learn_contradiction().sides) {
      const auto k = static_cast<std::size_t>(side / 2);
      if (before[k] != 0 || weight_[k] <= most) continue;
      most = weight_[k];
      pair = side / 2;
    }
  }
  zero_ = std::move(before);
  projection_->restore(node);
  return found_;
}

// What this node's refutation needs; nothing where a branch was found, or it is undecided.
std::optional<SetTree::Nogood> SetTree::refute() {
  if (const Nogood* const before = known()) return *before;
  if (is_over()) return std::nullopt;
  ++nodes_;
  run_->set_done(Phase::feasibility, nodes_);
  const Projection::End end = projection_->solve();
  if (end == Projection::End::contradiction) return learn_contradiction();
  if (end != Projection::End::point) return std::nullopt;
  if (const std::optional<Fork> fork = choose_clause()) return branch(*fork);
  Index pair = -1;
  if (try_smaller_sides(pair) || pair < 0) return std::nullopt;
  return branch_on_pair(pair);
}

std::optional<SetTree::Nogood> SetTree::branch_on_pair(Index pair) {
  const bool s_first =
      projection_->slacks()[problem_.layout.s(pair)] < projection_->slacks()[problem_.layout.t(pair)];
  const Index first = s_first ? 2 * pair : 2 * pair + 1;
  return branch({{first, opposite(first)}, {}});
}

std::optional<SetTree::Nogood> SetTree::branch(const Fork& fork) {
  Projection::State node;
  projection_->save(node);
  const double bytes = node_bytes(node);
  if (state_bytes_ + bytes > tuning::set_bytes) return std::nullopt;
  Nogood all = fork.rest;
  Reason reason;
  bool undecided = false;
  for (const Index side : fork.sides) {
    projection_->restore(node);
    fix(side);
    zero_of(side) = static_cast<std::uint8_t>(side % 2 + 1);
    state_bytes_ += bytes;
    std::optional<Nogood> child = refute();
    state_bytes_ -= bytes;
    zero_of(side) = 0;
    if (found_ || is_over()) return std::nullopt;
    if (!child) {  // another one may have a point
      undecided = true;
      continue;
    }
    if (!contains(child->sides, side)) return child;
    std::erase(child->sides, side);
    all.sides = united(all.sides, child->sides);
    reason.children.emplace_back(side, std::move(child->reason));
  }
  if (undecided) return std::nullopt;
  // Of a pair the second child is the rest: it has the opposite side of the first.
  if (fork.rest.reason != nullptr) reason.children.emplace_back(-1, fork.rest.reason);
  all.reason = run_->proof() != nullptr ? std::make_shared<const Reason>(std::move(reason)) : nullptr;
  learn(all);
  return all;
}

void SetTree::record(const Reason& reason, std::vector<std::uint8_t> zero) const {
  if (run_->proof()->bytes > run_->proof()->most_bytes) return;
  if (reason.leaf) {
    std::vector<Index> s_zero, t_zero;
    for (Index pair = 0; pair < problem_.pairs(); ++pair) {
      const std::uint8_t which = zero[static_cast<std::size_t>(pair)];
      if (which != 0) (which == 1 ? s_zero : t_zero).push_back(pair);
    }
    add_leaf(*run_->proof(), std::move(s_zero), std::move(t_zero), *reason.leaf);
    return;
  }
  for (const auto& [side, child] : reason.children) {
    if (side < 0) {
      record(*child, zero);
      continue;
    }
    std::uint8_t& which = zero[static_cast<std::size_t>(side / 2)];
    const auto here = static_cast<std::uint8_t>(side % 2 + 1);
    if (which == here) return record(*child, std::move(zero));  // no other child is
    if (which != 0) continue;
    which = here;
    record(*child, zero);
    which = static_cast<std::uint8_t>(opposite(side) % 2 + 1);
  }
}

SetTree::End SetTree::run(Run& run, ConstVectorRef z, std::int64_t most_nodes, const Accept& accept) {
  run_ = &run;
  accept_ = &accept;
  nodes_ = 0;
  most_nodes_ = most_nodes;
  found_ = false;
  zero_.assign(static_cast<std::size_t>(problem_.pairs()), 0);
  weight_.assign(static_cast<std::size_t>(problem_.pairs()), 1.0);
  clauses_.clear();
  nogoods_.clear();
  memory_ = {};
  state_bytes_ = 0.0;
  reason_bytes_ = 0;
  projection_.emplace(problem_);
  if (!projection_->start(run, z)) return End::stopped;
  ++nodes_;
  const Projection::End root = projection_->solve();
  if (root == Projection::End::interrupted) return End::stopped;
  if (root != Projection::End::contradiction) {
    if (!find_clauses()) return End::stopped;
    const auto is_set = [](const Clause& clause) { return clause.weak.size() > 2; };
    if (std::ranges::none_of(clauses_, is_set)) return End::stopped;
  }
  const std::optional<Nogood> nogood =
      root == Projection::End::contradiction ? learn_contradiction() : refute();
  if (found_) return End::found;
  if (!nogood || !nogood->sides.empty()) return End::stopped;
  if (Proof* const proof = run.proof()) {
    clear_leaves(*proof);
    proof->radius = radius();
    proof->bytes = reason_bytes_;  // if that is too much, there is none
    if (reason_bytes_ <= proof->most_bytes) {
      proof->bytes = 0;
      record(*nogood->reason, std::vector<std::uint8_t>(static_cast<std::size_t>(problem_.pairs()), 0));
    }
  }
  return End::refuted;
}

}  // namespace marble
