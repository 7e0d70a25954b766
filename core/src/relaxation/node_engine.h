// What solves the convex relaxation of a node: some pairs with one side fixed at zero, of the others both
// sides ≥ 0. It solves one node after the other and says what its multipliers prove.
#pragma once

#include <limits>
#include <vector>

#include "relaxation/dual_bound.h"
#include "relaxation/gram.h"
#include "run/proof_record.h"
#include "run/run.h"

namespace marble {

class NodeEngine {
 public:
  NodeEngine() = default;
  NodeEngine(const NodeEngine&) = delete;
  NodeEngine& operator=(const NodeEngine&) = delete;
  virtual ~NodeEngine() = default;

  /// Where the multipliers and slacks of all nodes are counted from.
  struct Center {
    Vector z, y, multipliers, slacks;
  };
  enum class End {
    optimal,      ///< solved, as exactly as bound() tells
    cutoff,       ///< bound() is no less than the cutoff
    infeasible,   ///< its multipliers contradict its rows
    undecided,    ///< neither; bound() is true all the same
    interrupted,  ///< bound() is that of its parent
  };

  /// From now on this may interrupt it.
  virtual void attend(const Interrupt& interrupt) = 0;
  /// Takes the problem's values. False if Q is not convex, or interrupted.
  [[nodiscard]] virtual bool prepare(Run& run) = 0;
  /// Whether Q is convex to rounding; prepares too.
  [[nodiscard]] virtual bool is_convex(Run& run) = 0;
  /// Nothing fixed, no row held, around z.
  [[nodiscard]] virtual bool start(ConstVectorRef z) = 0;
  /// No row fixed; these held, around a center.
  [[nodiscard]] virtual bool start(const Center& center, const std::vector<Index>& held,
                                   double parent_bound) = 0;
  /// A side of a pair is zero from now on.
  virtual void fix(Index row) = 0;
  /// Solves what is fixed now. `cutoff` and bounds are scaled objectives.
  [[nodiscard]] virtual End solve(const Box& box, double cutoff, const Interrupt& interrupt) = 0;

  /// Of these rows, none of them fixed, those that are zero together at some point of what was solved last,
  /// where the objective is higher by no more than `rise`. May be none wherever telling costs more than it
  /// saves; then nothing else is known of them.
  [[nodiscard]] virtual std::vector<Index> zero_together(const std::vector<Index>& /*rows*/, double /*rise*/,
                                                         const Interrupt& /*interrupt*/) {
    return {};
  }

  [[nodiscard]] virtual double bound() const = 0;
  /// The one of the last solve().
  [[nodiscard]] virtual Center center() const = 0;
  [[nodiscard]] virtual const Vector& z() const = 0;
  [[nodiscard]] virtual const Vector& y() const = 0;
  [[nodiscard]] virtual const Vector& multipliers() const = 0;
  [[nodiscard]] virtual const Vector& slacks() const = 0;  ///< 0 for rows held
  [[nodiscard]] virtual const std::vector<Index>& held() const = 0;
  [[nodiscard]] virtual bool is_held(Index row) const = 0;
  /// After infeasible: the multipliers that contradict its rows.
  [[nodiscard]] virtual const Vector& ray() const = 0;
  /// The same with the signs they must have and the y that belongs to them: all of that proof.
  [[nodiscard]] virtual LeafMultipliers contradiction() const = 0;
  /// K with its factor, until the next solve(). Null if interrupted.
  [[nodiscard]] virtual ProximalSystem* proximal_system(Run& run) = 0;
  /// So far.
  [[nodiscard]] virtual std::int64_t factorizations() const = 0;
  /// Of its factors.
  [[nodiscard]] virtual double bytes() = 0;

  /// All of it, to come back to.
  virtual void save() = 0;
  virtual void restore() = 0;

  /// From now on the best bound of each solve() is kept with what proves it: later steps may prove less.
  void keep_best(bool keep) { keeps_best_ = keep; }
  /// Of the last solve(); a bound of −∞ where it proved none, or another state was restored since.
  [[nodiscard]] const LeafMultipliers& best() const { return best_; }

 protected:
  void forget_best() { best_.bound = -std::numeric_limits<double>::infinity(); }
  void note(const Vector& z, const Vector& y, const Vector& multipliers, double bound) {
    if (keeps_best_ && bound > best_.bound) best_ = {false, z, y, multipliers, bound};
  }

 private:
  bool keeps_best_ = false;
  LeafMultipliers best_;
};

}  // namespace marble
