// What is decided about the incumbent at the end: whether it solves every branch it belongs to, and whether
// curvature makes it a local minimum. Where it does not, there is a way on to a better one.
#pragma once

#include <optional>
#include <span>

#include "proof/convexity.h"
#include "proof/proof.h"
#include "proof/second_order.h"
#include "search/incumbent.h"

namespace marble {

class Optimality {
 public:
  Optimality(const ScaledProblem& problem, Kkt& kkt, const Options& options, BranchPoint& point,
             Incumbent& incumbent);

  struct Verdict {
    /// True if it solves every branch it belongs to; absent if that was not decided.
    std::optional<bool> b_stationary;
    /// By its curvature on its branches: `minimum` also where it was not decided whether it is B-stationary.
    SecondOrder second_order = SecondOrder::unknown;
    std::optional<UnboundedRay> unbounded;  ///< what the way on from it led to
  };
  /// Of the incumbent, which may be another one afterwards.
  [[nodiscard]] Verdict judge(Run& run);

  struct Descended {
    bool from_saddle = false;  ///< where it began Q has negative curvature
    std::optional<UnboundedRay> unbounded;
  };
  /// From a point and the rows it holds at zero, along `first` if that is not empty, to a local minimum,
  /// which is offered to the incumbent, or to the proof that there is none.
  [[nodiscard]] Descended descend(Run& run, const Iterate& x, const WorkingSet& set, ConstVectorRef first);

  /// Whether Q is known to be convex, without a factorization.
  [[nodiscard]] bool known_convex() { return convexity_.known(); }
  /// The same by a factorization where that is not known.
  [[nodiscard]] bool convex(Run& run) { return convexity_.decide(run); }
  /// Q has new values.
  void forget_convexity() { convexity_.forget(); }

 private:
  [[nodiscard]] std::optional<bool> decide_b_stationarity(Run& run);
  [[nodiscard]] bool solves_its_branches(Run& run, std::span<const Index> biactive);
  [[nodiscard]] CriticalCurvature decide_second_order(Run& run);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  const Options& options_;
  BranchPoint& point_;
  Incumbent& incumbent_;
  Convexity convexity_;
  WorkingSet base_, branch_;
  std::optional<UnboundedRay> ray_;
  Images images_;
};

}  // namespace marble
