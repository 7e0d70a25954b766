#include "tree/expansion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tuning.h"

namespace marble {
namespace {

using End = Relaxation::End;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Sides with(Sides sides, bool s) {
  return static_cast<Sides>(static_cast<unsigned>(sides) |
                            static_cast<unsigned>(s ? Sides::s_zero : Sides::t_zero));
}

}  // namespace

Suggestion Expander::suggestion() const {
  return {relaxation_.z(), relaxation_.y(), relaxation_.set().multipliers(), relaxation_.set().held()};
}

void Expander::expand(Expansion& e, const Interrupt& interrupt) {
  e.outcome = Expansion::Outcome::interrupted;
  e.closed_bound = kInfinity;
  e.children.clear();
  e.bounded = 0;
  e.suggestion.reset();
  for (PseudoCosts::Gain& gain : e.gains) gain = {};
  if (interrupt.requested()) return;
  e.node.read(problem_.layout, fixings_, held_);
  const RowLayout& rows = problem_.layout;
  if (!relaxation_.start(*e.center, held_, e.node.bound)) return;
  for (Index pair = 0; pair < rows.pairs; ++pair) {
    if ((static_cast<unsigned>(fixings_[pair]) & 1U) != 0) relaxation_.fix(rows.s(pair));
    if ((static_cast<unsigned>(fixings_[pair]) & 2U) != 0) relaxation_.fix(rows.t(pair));
  }
  const End end = relaxation_.solve(*e.box, e.cutoff, interrupt);
  if (end == End::interrupted) return;
  e.node.bound = std::max(e.node.bound, relaxation_.bound());
  if (end == End::infeasible || end == End::cutoff) {
    e.outcome = Expansion::Outcome::closed;
    if (end == End::cutoff) e.closed_bound = e.node.bound;
    return;
  }
  const Index pair = choose(e);
  const bool free = pair >= 0;
  const Vector& v = relaxation_.set().slacks();
  const bool complementary =
      !free || std::min(v[rows.s(pair)], v[rows.t(pair)]) <= tuning::tree_complementary;
  if (e.suggest || (complementary && !e.node.exhausted)) e.suggestion = suggestion();
  if (!free || (complementary && !e.node.exhausted)) {
    e.outcome = free ? Expansion::Outcome::complementary : Expansion::Outcome::leaf;
    return;
  }
  relaxation_.save(state_);
  bound_child(e, pair, true, interrupt);
  relaxation_.restore(state_);
  bound_child(e, pair, false, interrupt);
  e.outcome = e.bounded == 2 ? Expansion::Outcome::branched : Expansion::Outcome::interrupted;
}

// The pair with the best score among those whose sides are both away from zero; if there is none, one whose
// smaller side is largest, or −1 where all are fixed.
Index Expander::choose(const Expansion& e) const {
  const Vector& v = relaxation_.set().slacks();
  Index best = -1, largest = -1;
  double best_score = -kInfinity, largest_side = -kInfinity;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    if (fixings_[pair] != Sides::relaxed) continue;
    const double s = v[problem_.layout.s(pair)];
    const double t = v[problem_.layout.t(pair)];
    if (std::min(s, t) > largest_side) {
      largest_side = std::min(s, t);
      largest = pair;
    }
    if (std::min(s, t) <= tuning::tree_complementary) continue;
    const double score = e.costs->score(pair, s, t);
    if (score <= best_score) continue;
    best_score = score;
    best = pair;
  }
  return best >= 0 ? best : largest;
}

void Expander::bound_child(Expansion& e, Index pair, bool s, const Interrupt& interrupt) {
  const Index row = s ? problem_.layout.s(pair) : problem_.layout.t(pair);
  const double amount = relaxation_.set().slacks()[row];
  const double before = relaxation_.bound();
  relaxation_.fix(row);
  const End end = relaxation_.solve(*e.box, e.cutoff, interrupt);
  if (end == End::interrupted) return;
  ++e.bounded;
  const bool closed = end == End::infeasible || end == End::cutoff;
  const double reached = closed ? e.cutoff : relaxation_.bound();
  e.gains[s ? 0 : 1] = {pair, s, amount, std::max(0.0, reached - before)};
  if (closed) {
    if (end == End::cutoff) e.closed_bound = std::min(e.closed_bound, relaxation_.bound());
    return;
  }
  Fixings child_fixings = fixings_;
  child_fixings[pair] = with(child_fixings[pair], s);
  Node child(problem_.layout, child_fixings, relaxation_.set().held());
  child.bound = relaxation_.bound();
  child.depth = e.node.depth + 1;
  e.children.push_back(std::move(child));
}

bool Expander::probe(Fixings& fixings, const Box& box, double cutoff, double& closed_bound,
                     const Interrupt& interrupt) {
  while (true) {
    const auto open = static_cast<int>(std::ranges::count(fixings, Sides::relaxed));
    const std::optional<int> fixed = probe_all(fixings, box, cutoff, closed_bound, interrupt);
    if (!fixed) return false;
    if (*fixed == 0 || *fixed < tuning::tree_probing_pays * open || interrupt.requested()) return true;
  }
}

// One round of it: how many it fixed, or nothing where a pair is left with neither side.
std::optional<int> Expander::probe_all(Fixings& fixings, const Box& box, double cutoff, double& closed_bound,
                                       const Interrupt& interrupt) {
  const RowLayout& rows = problem_.layout;
  int fixed = 0;
  for (Index pair = 0; pair < rows.pairs; ++pair) {
    for (const bool s : {true, false}) {
      const Index row = s ? rows.s(pair) : rows.t(pair);
      if (fixings[pair] != Sides::relaxed || relaxation_.set().is_held(row) || interrupt.requested())
        continue;
      relaxation_.save(state_);
      relaxation_.fix(row);
      const End end = relaxation_.solve(box, cutoff, interrupt);
      if (end == End::cutoff) closed_bound = std::min(closed_bound, relaxation_.bound());
      relaxation_.restore(state_);
      if (end != End::cutoff && end != End::infeasible) continue;
      fixings[pair] = s ? Sides::t_zero : Sides::s_zero;
      relaxation_.fix(s ? rows.t(pair) : rows.s(pair));
      ++fixed;
      const End rest = relaxation_.solve(box, cutoff, interrupt);
      if (rest == End::cutoff) closed_bound = std::min(closed_bound, relaxation_.bound());
      if (rest == End::cutoff || rest == End::infeasible) return std::nullopt;
    }
  }
  return fixed;
}

}  // namespace marble
