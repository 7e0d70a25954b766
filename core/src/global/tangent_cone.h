// Decides B-stationarity where many pairs are biactive: no direction of the tangent cone may descend.
//
// The cone is a union of convex cones, one for each choice of a side of every biactive pair. The projection
// of −∇f onto a relaxation, in which some of these pairs have both sides ≥ 0, is 0 exactly if no direction of
// the relaxation descends. If it is 0 for the root, there are multipliers with the signs of a strongly
// stationary point, even if those of the solution have other signs. Otherwise a tree fixes sides, one pair
// after the other. (Luo, Pang and Ralph, "Mathematical programs with equilibrium constraints", 1996, on
// B-stationarity.)
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "global/dual_active_set.h"
#include "model/residual.h"
#include "model/working_set.h"
#include "path/run.h"

namespace marble {

class TangentCone {
 public:
  enum class End {
    no_descent,  ///< the point is B-stationary
    descent,     ///< a direction descends: see branch()
    undecided,   ///< too many nodes, rounding, or interrupted
  };

  /// True if the active rows are few enough for dense factors.
  [[nodiscard]] static bool applies(const Images& images, std::span<const Index> biactive);

  /// The cone at a feasible point. Rows within tuning::zero of zero are active; `biactive` ascends.
  TangentCone(const ScaledProblem& problem, const Images& images, std::span<const Index> biactive);

  [[nodiscard]] End search(Run& run, int most_nodes);
  /// After `descent`: the branch of the direction, for a point with these sides fixed.
  [[nodiscard]] WorkingSet branch(WorkingSet set) const;

 private:
  using State = DualActiveSet::State;
  enum class Node { closed, open, descends, undecided };

  [[nodiscard]] bool start(Run& run);
  [[nodiscard]] Node solve(const Interrupt& interrupt);
  [[nodiscard]] Index row(std::size_t pair, bool s) const;
  [[nodiscard]] double zero() const;

  std::vector<Index> biactive_;
  ScaledProblem cone_;  // ½|d|² + gᵀd; its last rows are the sides s and t of each biactive pair in turn
  std::unique_ptr<Kkt> kkt_;
  std::optional<ProximalSystem> system_;
  std::optional<Gram> gram_;
  std::optional<GramColumns> columns_;
  std::optional<DualActiveSet> set_;
  std::size_t widest_ = 0;  // the pair that an open node branches on
};

}  // namespace marble
