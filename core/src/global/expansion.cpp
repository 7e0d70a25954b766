#include "global/expansion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "global/interior_point.h"
#include "model/tuning.h"

namespace marble {
namespace {

using End = NodeEngine::End;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::unique_ptr<NodeEngine> make_engine(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt, Gram& gram) {
  if (interior_point_pays(problem, *kkt)) return std::make_unique<InteriorPoint>(problem, std::move(kkt));
  return std::make_unique<Relaxation>(problem, std::move(kkt), gram);
}

}  // namespace

Expander::Expander(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt, Gram& gram)
    : problem_(problem), relaxation_(make_engine(problem, std::move(kkt), gram)) {}

Suggestion Expander::suggestion() const {
  return {relaxation_->z(), relaxation_->y(), relaxation_->multipliers(), relaxation_->held()};
}

void Expander::expand(Expansion& e, const Interrupt& interrupt) {
  const std::int64_t before = relaxation_->factorizations();
  expand_node(e, interrupt);
  e.factorizations = relaxation_->factorizations() - before;
}

void Expander::expand_node(Expansion& e, const Interrupt& interrupt) {
  e.outcome = Expansion::Outcome::interrupted;
  e.closed_bound = kInfinity;
  e.children.clear();
  e.bounded = 0;
  e.suggestion.reset();
  e.gains.clear();
  e.closed.clear();
  closed_.clear();
  keep(e.keep, e.record ? e.box : nullptr, e.node.record);
  if (interrupt.requested()) return;
  e.node.read(problem_.layout, fixings_, held_);
  const RowLayout& rows = problem_.layout;
  if (!relaxation_->start(*e.center, held_, e.node.bound)) return;
  fix(fixings_);
  const End end = relaxation_->solve(*e.box, e.cutoff, interrupt);
  if (end == End::interrupted) return;
  e.node.bound = std::max(e.node.bound, relaxation_->bound());
  if (end == End::infeasible || end == End::cutoff) {
    e.outcome = Expansion::Outcome::closed;
    if (end == End::cutoff) e.closed_bound = e.node.bound;
    close(fixings_, end);
    e.closed = take_closed();
    return;
  }
  if (keep_) e.node.keep(rows, relaxation_->multipliers(), Node::Proof::bound);
  if (record_ != nullptr) e.node.record = inherited_ = record(fixings_);
  const Choice choice = choose(e);
  const Index pair = choice.pair;
  const bool free = pair >= 0;
  const Vector& v = relaxation_->slacks();
  const bool complementary = !free || std::min(v[rows.s(pair)], v[rows.t(pair)]) <= tuning::zero;
  if (e.suggest || (complementary && !e.node.exhausted)) e.suggestion = suggestion();
  if (!free || (complementary && !e.node.exhausted)) {
    e.outcome = free ? Expansion::Outcome::complementary : Expansion::Outcome::leaf;
    return;
  }
  relaxation_->save();
  const ClauseChoice clause = choose_clause(e, choice.gain);
  if (clause.clause != nullptr) {
    expand_clause(e, clause, interrupt);
  } else if (bound_child(e, pair, true, interrupt)) {
    relaxation_->restore();
    if (bound_child(e, pair, false, interrupt)) e.outcome = Expansion::Outcome::branched;
  }
  e.closed = take_closed();
}

Node Expander::node(const Fixings& fixings, End end) const {
  Node node(problem_.layout, fixings, relaxation_->held());
  node.bound = relaxation_->bound();
  if (!keep_) return node;
  const bool infeasible = end == End::infeasible;
  node.keep(problem_.layout, infeasible ? relaxation_->ray() : relaxation_->multipliers(),
            infeasible ? Node::Proof::contradiction : Node::Proof::bound);
  if (record_ != nullptr) node.record = infeasible ? contradiction() : record(fixings);
  return node;
}

std::shared_ptr<const LeafMultipliers> Expander::contradiction() const {
  return std::make_shared<const LeafMultipliers>(relaxation_->contradiction());
}

// The proof of a node may be that of its parent, if its own multipliers prove less.
std::shared_ptr<const LeafMultipliers> Expander::record(const Fixings& fixings) const {
  LeafMultipliers own{false, relaxation_->z(), relaxation_->y(), {}};
  const auto fixed = [&](Index row) { return is_fixed(problem_.layout, fixings, row); };
  take_signs(relaxation_->multipliers(), fixed, own.rows);
  own.bound = DualBound(problem_).of_objective(*record_, own.z, own.y, own.rows);
  if (relaxation_->best().bound > own.bound) own = relaxation_->best();
  if (inherited_ && inherited_->bound >= own.bound) return inherited_;
  return std::make_shared<const LeafMultipliers>(std::move(own));
}

void Expander::close(const Fixings& fixings, End end) {
  if (keep_) closed_.push_back(node(fixings, end));
}

void Expander::fix(const Fixings& fixings) {
  const RowLayout& rows = problem_.layout;
  for (Index pair = 0; pair < rows.pairs; ++pair) {
    if (has_s(fixings[pair])) relaxation_->fix(rows.s(pair));
    if (has_t(fixings[pair])) relaxation_->fix(rows.t(pair));
  }
}

// Makes one child for each member that may take its strong side, with the members before it on their weak
// side. The most promising child comes first.
void Expander::expand_clause(Expansion& e, const ClauseChoice& choice, const Interrupt& interrupt) {
  for (const Clause::Member& member : choice.open) {
    relaxation_->restore();
    fix(fixings_);
    if (!bound_child(e, member.pair, member.strong_s, interrupt)) return;
    fixings_[member.pair] = with(fixings_[member.pair], !member.strong_s);
  }
  e.outcome = Expansion::Outcome::branched;
  if (!keep_) return;
  closed_.emplace_back(problem_.layout, fixings_, std::vector<Index>());
  closed_.back().keep(problem_.layout, choice.clause->contradiction, Node::Proof::contradiction);
  closed_.back().record = choice.clause->record;
}

// Returns the pair with the best score among those whose sides are both away from zero. If there are none,
// one whose smaller side is largest, or −1 if all pairs are fixed.
Expander::Choice Expander::choose(const Expansion& e) const {
  const Vector& v = relaxation_->slacks();
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
    if (std::min(s, t) <= tuning::zero) continue;
    const double score = e.costs->score(pair, s, t);
    if (score <= best_score) continue;
    best_score = score;
    best = pair;
  }
  if (best < 0) return {largest, 0.0};
  return {best, std::min(e.costs->gain(best, true, v[problem_.layout.s(best)]),
                         e.costs->gain(best, false, v[problem_.layout.t(best)]))};
}

// Returns the clause with the largest expected gain in its worst child; none if that gain is not above that
// of a single pair.
Expander::ClauseChoice Expander::choose_clause(const Expansion& e, double gain) const {
  const Vector& v = relaxation_->slacks();
  const auto expected = [&](const Clause::Member& member) {
    const Index row = member.strong_s ? problem_.layout.s(member.pair) : problem_.layout.t(member.pair);
    return e.costs->gain(member.pair, member.strong_s, v[row]);
  };
  ClauseChoice best;
  for (const Clause& clause : *e.clauses) {
    std::vector<Clause::Member> open = clause.open(fixings_);
    if (open.empty() || static_cast<std::int64_t>(open.size()) > e.most_children) continue;
    std::ranges::stable_sort(open, {}, expected);
    if (expected(open.front()) <= gain) continue;
    gain = expected(open.front());
    best = {&clause, std::move(open)};
  }
  return best;
}

// Returns false if interrupted.
bool Expander::bound_child(Expansion& e, Index pair, bool s, const Interrupt& interrupt) {
  const Index row = s ? problem_.layout.s(pair) : problem_.layout.t(pair);
  const double amount = relaxation_->slacks()[row];
  const double before = relaxation_->bound();
  relaxation_->fix(row);
  const End end = relaxation_->solve(*e.box, e.cutoff, interrupt);
  if (end == End::interrupted) return false;
  ++e.bounded;
  const bool closed = end == End::infeasible || end == End::cutoff;
  const double reached = closed ? e.cutoff : relaxation_->bound();
  e.gains.push_back({pair, s, amount, std::max(0.0, reached - before)});
  Fixings child_fixings = fixings_;
  child_fixings[pair] = with(child_fixings[pair], s);
  if (closed) {
    if (end == End::cutoff) e.closed_bound = std::min(e.closed_bound, relaxation_->bound());
    close(child_fixings, end);
    return true;
  }
  Node child = node(child_fixings, end);
  child.depth = e.node.depth + 1;
  e.children.push_back(std::move(child));
  return true;
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

// Sides that are zero together where the objective is hardly above its minimum cannot be closed: fixing them
// gains nothing. (Gleixner, Berthold, Müller and Weltge, "Three enhancements for optimization-based bound
// tightening", 2017.)
void Expander::skip_idle(const Fixings& fixings, double rise, const Interrupt& interrupt) {
  const RowLayout& rows = problem_.layout;
  idle_.assign(static_cast<std::size_t>(rows.size()), 0);
  for (const bool s : {true, false}) {
    std::vector<Index> open, zero;
    for (Index pair = 0; pair < rows.pairs; ++pair) {
      const Index row = s ? rows.s(pair) : rows.t(pair);
      if (fixings[pair] == Sides::relaxed && !relaxation_->is_held(row)) open.push_back(row);
    }
    do {
      zero = relaxation_->zero_together(open, rise, interrupt);
      for (const Index row : zero) {
        idle_[static_cast<std::size_t>(row)] = 1;
        probed_.push_back({rows.pair_of(row), s, relaxation_->slacks()[row], 0.0});
      }
      std::erase_if(open, [this](Index row) { return idle_[static_cast<std::size_t>(row)] != 0; });
    } while (zero.size() > 1 && open.size() > 1);  // it costs as much as trying one side
  }
}

// Runs one round of probing. Returns the number of fixed pairs, or nothing if neither side of a pair is
// possible. The relaxation is solved again after every few of them.
std::optional<int> Expander::probe_all(Fixings& fixings, const Box& box, double cutoff, double& closed_bound,
                                       const Interrupt& interrupt) {
  const RowLayout& rows = problem_.layout;
  probed_.clear();
  skip_idle(fixings, tuning::tree_idle_rise * (cutoff - relaxation_->bound()), interrupt);
  int fixed = 0, waiting = 0;
  const auto is_left = [&] {
    waiting = 0;
    const End rest = relaxation_->solve(box, cutoff, interrupt);
    if (rest == End::cutoff) closed_bound = std::min(closed_bound, relaxation_->bound());
    if (rest != End::cutoff && rest != End::infeasible) return true;
    close(fixings, rest);
    return false;
  };
  for (Index pair = 0; pair < rows.pairs; ++pair) {
    for (const bool s : {true, false}) {
      const Index row = s ? rows.s(pair) : rows.t(pair);
      if (fixings[pair] != Sides::relaxed || idle_[static_cast<std::size_t>(row)] != 0 ||
          relaxation_->is_held(row) || interrupt.requested())
        continue;
      const double amount = relaxation_->slacks()[row];
      const double before = relaxation_->bound();
      relaxation_->save();
      relaxation_->fix(row);
      const End end = relaxation_->solve(box, cutoff, interrupt);
      if (end == End::optimal) probed_.push_back({pair, s, amount, relaxation_->bound() - before});
      if (end == End::cutoff) closed_bound = std::min(closed_bound, relaxation_->bound());
      if (end == End::cutoff || end == End::infeasible) {
        fixings[pair] = s ? Sides::s_zero : Sides::t_zero;
        close(fixings, end);
      }
      relaxation_->restore();
      if (end != End::cutoff && end != End::infeasible) continue;
      fixings[pair] = s ? Sides::t_zero : Sides::s_zero;
      relaxation_->fix(s ? rows.t(pair) : rows.s(pair));
      ++fixed;
      if (++waiting >= tuning::tree_round && !is_left()) return std::nullopt;
    }
  }
  if (waiting > 0 && !is_left()) return std::nullopt;
  return fixed;
}

bool Expander::is_feasible(Fixings fixings, const std::vector<Clause::Member>& weak,
                           const NodeEngine::Center& center, const Box& box, const Interrupt& interrupt) {
  for (const Clause::Member& member : weak)
    fixings[member.pair] = with(fixings[member.pair], !member.strong_s);
  if (!relaxation_->start(center, {}, -kInfinity)) return true;
  fix(fixings);
  if (relaxation_->solve(box, kInfinity, interrupt) != End::infeasible) return true;
  contradiction_ = relaxation_->ray();
  if (record_ != nullptr) contradiction_record_ = contradiction();
  return false;
}

// Removes members from a contradictory set, by halves, until no member can be left out. (Chinneck and
// Dravnieks, "Locating minimal infeasible constraint sets in linear programs", 1991.)
std::vector<Clause::Member> Expander::shrink(const Fixings& fixings, std::vector<Clause::Member> members,
                                             const NodeEngine::Center& center, const Box& box,
                                             const Interrupt& interrupt) {
  std::size_t kept = 0;  // this many at the front are needed
  std::size_t step = std::max<std::size_t>(1, members.size() / 2);
  while (kept < members.size()) {
    step = std::min(step, members.size() - kept);
    std::vector<Clause::Member> fewer = members;
    const auto begin = fewer.begin() + static_cast<std::ptrdiff_t>(kept);
    fewer.erase(begin, begin + static_cast<std::ptrdiff_t>(step));
    if (!is_feasible(fixings, fewer, center, box, interrupt)) {
      members = std::move(fewer);
    } else if (step == 1) {
      ++kept;
    } else {
      step /= 2;
    }
    if (interrupt.requested()) return {};
  }
  return members;
}

std::vector<Clause> Expander::find_clauses(const Fixings& fixings, const NodeEngine::Center& center,
                                           const Box& box, const Interrupt& interrupt) {
  // The strong side is the one that gains more. A side that was not probed, or gave no number, gains nothing.
  std::vector<double> balance(fixings.size(), 0.0);
  for (const PseudoCosts::Gain& gain : probed_)
    balance[static_cast<std::size_t>(gain.pair)] += gain.s ? gain.gain : -gain.gain;
  std::vector<Clause::Member> left;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    if (fixings[pair] == Sides::relaxed)
      left.push_back({pair, balance[static_cast<std::size_t>(pair)] > 0.0});
  }
  std::vector<Clause> clauses;
  while (left.size() > 1 && !is_feasible(fixings, left, center, box, interrupt)) {
    Clause clause{shrink(fixings, left, center, box, interrupt)};
    clause.contradiction = contradiction_;
    clause.record = contradiction_record_;
    if (clause.members.empty()) break;
    std::erase_if(left, [&clause](const Clause::Member& member) {
      return std::ranges::any_of(clause.members,
                                 [&member](const auto& other) { return other.pair == member.pair; });
    });
    if (clause.members.size() > 1) clauses.push_back(std::move(clause));
  }
  return clauses;
}

}  // namespace marble
