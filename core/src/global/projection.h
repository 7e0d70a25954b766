// The point nearest to a target that some rows leave: all inequalities, and sides of pairs that are fixed at
// zero. Either that point, or multipliers that contradict the rows, and which of the fixed sides they need.
//
// One factor serves them all: a further side is one more row for the dual active set.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "global/dual_active_set.h"
#include "global/interior_point.h"
#include "path/run.h"

namespace marble {

class Projection {
 public:
  enum class End {
    point,          ///< z()
    contradiction,  ///< proved by contradiction()
    undecided,      ///< neither was found
    interrupted,
  };
  using State = DualActiveSet::State;

  explicit Projection(const ScaledProblem& problem);

  /// Memory, of the columns of all rows and of a factor.
  [[nodiscard]] static double most_bytes(const ScaledProblem& problem);
  /// Nothing fixed; near the target, scaled. False if interrupted, or without a factor. The run counts the
  /// work of all that follows, and ends it.
  [[nodiscard]] bool start(Run& run, ConstVectorRef target);
  /// A side of a pair is zero from now on.
  void fix(Index row) { set_->set_kind(row, DualActiveSet::RowKind::fixed); }
  /// Of C: what contradicts then are equalities and sides alone.
  void ignore_inequalities();
  [[nodiscard]] End solve();

  /// Of the last solve, where it did not contradict; scaled, like the rows' values.
  [[nodiscard]] Vector z();
  [[nodiscard]] const Vector& slacks() const { return set_->slacks(); }
  [[nodiscard]] const std::vector<Index>& held() const { return set_->held(); }

  /// Of the last contradiction: the fixed sides that have to be zero for it, ascending. The others are needed
  /// as inequalities, or not at all.
  [[nodiscard]] const std::vector<Index>& needed() const { return needed_; }
  [[nodiscard]] LeafMultipliers contradiction() const { return contradiction_; }
  /// Contradictions hold for |z|∞ up to this, user units.
  [[nodiscard]] double radius() const;

  void save(State& state) const { set_->save(state); }
  void restore(const State& state) { set_->restore(state); }

 private:
  [[nodiscard]] std::unique_ptr<Kkt> make_engine();
  [[nodiscard]] bool is_fixed(Index row) const { return set_->kind(row) == DualActiveSet::RowKind::fixed; }
  void center();
  [[nodiscard]] bool prove(const Vector& ray);
  [[nodiscard]] bool accept(LeafMultipliers proof);
  void index_entries();
  void clean(LeafMultipliers& proof) const;
  [[nodiscard]] bool prove_from_nothing();

  Run* run_ = nullptr;
  ScaledProblem nearest_;                  // ½|z − target|² as its objective
  std::unique_ptr<Kkt> kkt_, kkt_beside_;  // of all nodes' system; of one ray's rows
  std::unique_ptr<InteriorPoint> interior_;
  LeafMultipliers contradiction_;
  std::optional<ProximalSystem> system_;
  std::optional<Gram> gram_;
  std::optional<GramColumns> columns_;
  std::optional<DualActiveSet> set_;
  std::optional<Box> box_;
  double far_ = 0.0;
  std::vector<std::vector<std::pair<Index, double>>> entries_;  // of each column: rows, the shortest first
  std::vector<Index> needed_;
};

}  // namespace marble
