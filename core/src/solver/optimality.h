// The final decisions about the incumbent: whether it solves every branch that it belongs to, and whether its
// curvature makes it a local minimum. If not, the search moves on to a better solution.
#pragma once

#include <limits>
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
    /// True if it solves every branch that it belongs to; absent if that was not decided.
    std::optional<bool> b_stationary;
    /// The result of the curvature test on its branches: `minimum` even if B-stationarity was not decided.
    SecondOrder second_order = SecondOrder::unknown;
    std::optional<UnboundedRay> unbounded;  ///< found on the way to a better solution
  };
  /// Judges the incumbent, and may replace it. Up to that count of factorizations, it solves branches that
  /// decide B-stationarity.
  [[nodiscard]] Verdict judge(Run& run, int last_factorization = std::numeric_limits<int>::max());
  /// Searches the tangent cone of an incumbent whose B-stationarity judge() has not decided. Returns true if
  /// it is B-stationary, false if a better solution has replaced it, and nothing if that is not decided.
  [[nodiscard]] std::optional<bool> search_tangent_cone(Run& run);

  struct Descended {
    bool from_saddle = false;  ///< Q has negative curvature at the first point
    std::optional<UnboundedRay> unbounded;
  };
  /// Descends from a point and the rows that it holds at zero, along `first` unless that is empty. Offers the
  /// local minimum to the incumbent, or returns the proof that there is none.
  [[nodiscard]] Descended descend(Run& run, const Iterate& x, const WorkingSet& set, ConstVectorRef first);

  /// True if Q is known to be convex, without a factorization.
  [[nodiscard]] bool known_convex() { return convexity_.known(); }
  /// Decides the same by a factorization if it is not known.
  [[nodiscard]] bool convex(Run& run) { return convexity_.decide(run); }
  /// Call this when Q has new values.
  void forget_convexity() { convexity_.forget(); }

 private:
  [[nodiscard]] std::optional<bool> decide_b_stationarity(Run& run, int last_factorization);
  [[nodiscard]] bool solves_its_branches(Run& run, std::span<const Index> biactive, int last_factorization);
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
