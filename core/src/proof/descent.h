// Descends on one branch when Q need not be convex: the primal active-set method from a feasible point.
//
// While Q is convex on the rows held at zero, the method goes towards the minimum there. It stops at the
// first row that blocks and holds it too. At a minimum it releases the row with the largest wrong-sign
// multiplier. If Q is not convex there, it follows a direction of negative curvature until a row blocks; if
// none does, the objective is unbounded. The objective never rises. (Gill, Murray, Saunders and Wright,
// "Inertia-controlling methods for general quadratic programming", 1991.)
#pragma once

#include "branch/branch_point.h"
#include "model/tuning.h"
#include "path/reporter.h"

namespace marble {

class Descent {
 public:
  enum class End {
    minimum,    ///< x() is stationary and Q has no negative curvature on the rows of set()
    unbounded,  ///< apparently, from x() along direction(): no row blocks
    stopped,    ///< by the budget, an interruption or rounding
  };

  /// Uses `point` as workspace.
  Descent(const ScaledProblem& problem, Kkt& kkt, BranchPoint& point);

  /// Runs from a point and the rows that it holds at zero. If `first` is not empty, it must be a direction of
  /// negative curvature that keeps these rows, and the first step follows it.
  [[nodiscard]] End run(Run& run, const Iterate& x, const WorkingSet& set, ConstVectorRef first, int budget);

  [[nodiscard]] const Iterate& x() const { return x_; }
  [[nodiscard]] const Images& images() const { return images_; }
  [[nodiscard]] const WorkingSet& set() const { return set_; }
  [[nodiscard]] const Vector& direction() const { return direction_; }
  /// True if the start was not a local minimum: it had a direction of negative curvature.
  [[nodiscard]] bool began_at_saddle() const { return began_at_saddle_; }

 private:
  struct Block {
    std::uint8_t* flag = nullptr;  // of the row that stops the step; null if none does
    double length = 0.0;
  };
  [[nodiscard]] Block blocking(double longest);
  [[nodiscard]] bool find_negative_curvature(Run& run, int last);
  [[nodiscard]] bool iterate_inversely();
  void orient();
  void move(const Block& block);
  [[nodiscard]] bool release_worst();
  void report(Run& run);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  BranchPoint& point_;
  Iterate x_;
  WorkingSet set_;
  Images images_, rates_;
  Vector direction_, image_, nothing_;
  double delta_ = tuning::elastic_delta;  // the last δ at which Q became convex on the rows held
  int short_steps_ = 0;                   // consecutive ones
  bool began_at_saddle_ = false;
  Reporter reporter_;
};

}  // namespace marble
