// Whether Q is convex: found at need, once for all solves with it.
#pragma once

#include "kkt/kkt.h"
#include "run/run.h"

namespace marble {

class Convexity {
 public:
  Convexity(const ScaledProblem& problem, Kkt& kkt) : problem_(problem), kkt_(kkt) {}

  /// Whether that is known without a factorization: of a Q that is diagonally dominant, zero included, or
  /// after decide(). O(entries) the first time.
  [[nodiscard]] bool known();
  /// The same by one factorization where it is not known yet. False also where that is interrupted.
  [[nodiscard]] bool decide(Run& run);
  /// Q has new values.
  void forget() { state_ = State::unseen; }

 private:
  enum class State { unseen, unknown, convex, indefinite };

  const ScaledProblem& problem_;
  Kkt& kkt_;
  State state_ = State::unseen;
};

}  // namespace marble
