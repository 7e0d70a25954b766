#include "global/refutation.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"
#include "path/run.h"

namespace marble {
Refutation::Refutation(const Problem& problem, const Options& options, const SolveControls& controls,
                       const SetupControls& setup)
    : rows_(problem, options, controls, setup),
      numbers_(problem),
      interrupt_(interrupt_of(controls, options)),
      zero_(static_cast<std::size_t>(problem.pairs())),
      weight_(static_cast<std::size_t>(problem.pairs()), 1.0) {}

bool Refutation::is_over() const { return nodes_ >= Options().node_limit || interrupt_.requested(); }

// Returns the distance of a pair from having a side at zero, or 0 if it is within the tolerance.
double Refutation::apart(Index pair, ConstVectorRef z) const {
  const double least =
      std::min(std::abs(rows_.value(numbers_.s(pair), z)), std::abs(rows_.value(numbers_.t(pair), z)));
  return least <= rows_.tolerance(numbers_.s(pair)) ? 0.0 : least;
}

bool Refutation::is_met(const Parts& parts, ConstVectorRef z) const {
  for (Index row = 0; row < rows_.rows(); ++row) {
    if (parts[static_cast<std::size_t>(row)] == 0) continue;
    const double value = rows_.value(row, z), most = rows_.tolerance(row);
    if (value < -most || (row < rows_.problem().equalities() && value > most)) return false;
  }
  for (Index pair = 0; pair < numbers_.pairs; ++pair) {
    if (parts[static_cast<std::size_t>(numbers_.complementarity(pair))] != 0 && apart(pair, z) > 0.0)
      return false;
  }
  return true;
}

std::vector<HeldRow> Refutation::rows_here() const {
  std::vector<HeldRow> rows;
  for (Index row = 0; row < rows_.rows(); ++row) {
    const Index side = row - numbers_.first_side;
    const std::uint8_t which = side < numbers_.pairs ? 1 : 2;
    const bool zero =
        side >= 0 && zero_[static_cast<std::size_t>(side % std::max<Index>(numbers_.pairs, 1))] == which;
    if (zero || parts_[static_cast<std::size_t>(row)] != 0)
      rows.push_back({row, zero || row < rows_.problem().equalities()});
  }
  return rows;
}

const Refutation::Nogood* Refutation::known() const {
  const auto holds = [this](const Nogood& nogood) {
    return are_zero(nogood.sides, zero_) && std::ranges::all_of(nogood.parts, [this](Index part) {
             return parts_[static_cast<std::size_t>(part)] != 0;
           });
  };
  const auto found = std::ranges::find_if(nogoods_, holds);
  return found == nogoods_.end() ? nullptr : &*found;
}

void Refutation::learn(const Nogood& nogood) {
  for (const Index side : nogood.sides) weight_[static_cast<std::size_t>(side / 2)] += 1.0;
  if (nogoods_.size() < tuning::conflict_nogoods &&
      memory_.may_keep(nogood.parts.size() + nogood.sides.size()))
    nogoods_.push_back(nogood);
}

// Returns the parts and sides of the current contradiction, reduced to a vertex of its multipliers. A side
// that is zero in this node and has an inequality's sign only needs to be nonnegative, if that is one of the
// parts.
Refutation::Nogood Refutation::reason(std::vector<HeldRow> rows) {
  const auto needed = [this](const std::vector<HeldRow>& of) {
    std::vector<HeldRow> some;
    for (std::size_t k = 0; k < of.size(); ++k) {
      const double multiplier = rows_.multipliers()[k];
      if (multiplier == 0.0) continue;
      const bool may_be_side = of[k].row >= numbers_.first_side && multiplier < 0.0 &&
                               parts_[static_cast<std::size_t>(of[k].row)] != 0;
      some.push_back({of[k].row, of[k].equality && !may_be_side});
    }
    return some;
  };
  const std::vector<HeldRow> all = needed(rows);
  // The signs at the vertex are those of the next proof, which uses only these rows.
  if (const std::vector<HeldRow> few = rows_.vertex(rows);
      !few.empty() && few.size() < all.size() && rows_.decide(few) == LinearRows::End::contradiction) {
    rows = needed(few);
  } else {
    rows = all;
  }
  Nogood nogood;
  for (const HeldRow& held : rows) {
    const Index side = held.row - numbers_.first_side;
    if (side < 0 || !held.equality) {
      nogood.parts.push_back(held.row);
    } else {
      nogood.sides.push_back(side < numbers_.pairs ? 2 * side : 2 * (side - numbers_.pairs) + 1);
    }
  }
  std::ranges::sort(nogood.parts);
  std::ranges::sort(nogood.sides);
  return nogood;
}

// Prefers pairs that occurred in earlier refutations.
Index Refutation::pair_to_fork(ConstVectorRef z) const {
  Index best = -1;
  double most = 0.0;
  for (Index pair = 0; pair < numbers_.pairs; ++pair) {
    const auto at = static_cast<std::size_t>(pair);
    if (zero_[at] != 0 || parts_[static_cast<std::size_t>(numbers_.complementarity(pair))] == 0) continue;
    const double score = weight_[at] * apart(pair, z);
    if (score <= most) continue;
    most = score;
    best = pair;
  }
  return best;
}

// Uses only the rows of this node.
std::optional<Refutation::Nogood> Refutation::refute_rows(bool& feasible) {
  std::vector<HeldRow> rows = rows_here();
  const LinearRows::End end = rows_.decide(rows);
  feasible = end == LinearRows::End::feasible;
  if (end != LinearRows::End::contradiction) return std::nullopt;
  Nogood nogood = reason(std::move(rows));
  learn(nogood);
  return nogood;
}

// Returns the nogood of this node, or nothing if it has a point (found_) or is undecided.
std::optional<Refutation::Nogood> Refutation::refute() {
  if (const Nogood* const before = known()) return *before;
  if (is_over() || depth_ > tuning::conflict_depth) return std::nullopt;
  ++nodes_;
  bool feasible = false;
  if (std::optional<Nogood> nogood = refute_rows(feasible); !feasible) return nogood;
  const Index pair = pair_to_fork(rows_.z());
  if (pair >= 0) return fork(pair);
  found_ = is_met(parts_, rows_.z());
  if (found_ && points_.size() < tuning::conflict_nogoods &&
      memory_.may_keep(static_cast<std::size_t>(rows_.z().size())))
    points_.push_back(rows_.z());
  return std::nullopt;
}

std::optional<Refutation::Nogood> Refutation::fork(Index pair) {
  const bool s_first = std::abs(rows_.value(numbers_.s(pair), rows_.z())) <=
                       std::abs(rows_.value(numbers_.t(pair), rows_.z()));
  std::optional<Nogood> both;
  bool undecided = false;
  for (const bool s : {s_first, !s_first}) {
    zero_[static_cast<std::size_t>(pair)] = s ? 1 : 2;
    ++depth_;
    std::optional<Nogood> child = refute();
    --depth_;
    zero_[static_cast<std::size_t>(pair)] = 0;
    if (found_) return std::nullopt;
    if (!child) {  // the other child may have a point
      undecided = true;
      continue;
    }
    const auto at = std::ranges::find(child->sides, s ? 2 * pair : 2 * pair + 1);
    if (at == child->sides.end()) return child;
    child->sides.erase(at);
    both = both ? Nogood{united(both->parts, child->parts), united(both->sides, child->sides)}
                : std::move(*child);
  }
  if (undecided || !both) return std::nullopt;
  both->parts = united(both->parts, {numbers_.complementarity(pair)});
  learn(*both);
  return both;
}

Refutation::End Refutation::run(const Parts& parts) {
  parts_ = parts;
  found_ = false;
  std::ranges::fill(zero_, std::uint8_t{0});
  if (std::ranges::any_of(points_, [&](const Vector& z) { return is_met(parts, z); })) return End::feasible;
  const std::optional<Nogood> root = refute();
  if (found_) return End::feasible;
  if (!root) return End::undecided;
  support_.assign(parts.size(), 0);
  for (const Index part : root->parts) support_[static_cast<std::size_t>(part)] = 1;
  return End::refuted;
}

}  // namespace marble
