// The interface of engines that solve the convex relaxation of a node: some pairs have one side fixed at
// zero, and both sides of the others are ≥ 0. An engine solves one node after the other and returns what its
// multipliers prove.
#pragma once

#include <limits>
#include <vector>

#include "global/dual_bound.h"
#include "global/gram.h"
#include "path/proof_record.h"
#include "path/run.h"

namespace marble {

class NodeEngine {
 public:
  NodeEngine() = default;
  NodeEngine(const NodeEngine&) = delete;
  NodeEngine& operator=(const NodeEngine&) = delete;
  virtual ~NodeEngine() = default;

  /// The reference point of the multipliers and slacks of all nodes.
  struct Center {
    Vector z, y, multipliers, slacks;
  };
  enum class End {
    optimal,      ///< solved, as exactly as bound() shows
    cutoff,       ///< bound() is not below the cutoff
    infeasible,   ///< its multipliers contradict its rows
    undecided,    ///< none of these; bound() still holds
    interrupted,  ///< bound() is that of its parent
  };

  /// Sets the interrupt, from now on.
  virtual void attend(const Interrupt& interrupt) = 0;
  /// Loads the problem's values. Returns false if Q is not convex, or if interrupted.
  [[nodiscard]] virtual bool prepare(Run& run) = 0;
  /// True if Q is convex to rounding; also prepares the engine.
  [[nodiscard]] virtual bool is_convex(Run& run) = 0;
  /// Starts around z with nothing fixed and no row held.
  [[nodiscard]] virtual bool start(ConstVectorRef z) = 0;
  /// Starts around a center with nothing fixed and these rows held.
  [[nodiscard]] virtual bool start(const Center& center, const std::vector<Index>& held,
                                   double parent_bound) = 0;
  /// Fixes a side of a pair at zero.
  virtual void fix(Index row) = 0;
  /// Solves the relaxation with the current fixings. `cutoff` and bounds are scaled objectives.
  [[nodiscard]] virtual End solve(const Box& box, double cutoff, const Interrupt& interrupt) = 0;

  /// Returns those of these rows, none of them fixed, that are zero together at some point of the last solved
  /// relaxation whose objective is higher by at most `rise`. Returns none if finding them costs more than it
  /// saves; nothing else is then known about them.
  [[nodiscard]] virtual std::vector<Index> zero_together(const std::vector<Index>& /*rows*/, double /*rise*/,
                                                         const Interrupt& /*interrupt*/) {
    return {};
  }

  [[nodiscard]] virtual double bound() const = 0;
  /// The center of the last solve().
  [[nodiscard]] virtual Center center() const = 0;
  [[nodiscard]] virtual const Vector& z() const = 0;
  [[nodiscard]] virtual const Vector& y() const = 0;
  [[nodiscard]] virtual const Vector& multipliers() const = 0;
  [[nodiscard]] virtual const Vector& slacks() const = 0;  ///< 0 for held rows
  [[nodiscard]] virtual const std::vector<Index>& held() const = 0;
  [[nodiscard]] virtual bool is_held(Index row) const = 0;
  /// After infeasible: the multipliers that contradict the rows.
  [[nodiscard]] virtual const Vector& ray() const = 0;
  /// The same with the required signs and with the corresponding y: the whole proof.
  [[nodiscard]] virtual LeafMultipliers contradiction() const = 0;
  /// Returns K with its factor, valid until the next solve(). Null if interrupted.
  [[nodiscard]] virtual ProximalSystem* proximal_system(Run& run) = 0;
  /// Returns the factorizations so far.
  [[nodiscard]] virtual std::int64_t factorizations() const = 0;
  /// Returns the memory of its factors.
  [[nodiscard]] virtual double bytes() = 0;

  /// Saves the whole state, for restore().
  virtual void save() = 0;
  virtual void restore() = 0;

  /// From now on keeps the best bound of each solve() with its proof, since later steps may prove less.
  void keep_best(bool keep) { keeps_best_ = keep; }
  /// Of the last solve(); its bound is −∞ if none was proved, or if another state was restored since.
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
