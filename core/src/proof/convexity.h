// Decides whether Q is convex: on demand, once for all solves with this Q.
#pragma once

#include "kkt/kkt.h"
#include "path/run.h"

namespace marble {

class Convexity {
 public:
  Convexity(const ScaledProblem& problem, Kkt& kkt) : problem_(problem), kkt_(kkt) {}

  /// True if Q is known to be convex without a factorization: if it is diagonally dominant (zero included),
  /// or after decide(). O(entries) in the first call.
  [[nodiscard]] bool known();
  /// The same, with one factorization if it is not known yet. Also returns false if that is interrupted.
  [[nodiscard]] bool decide(Run& run);
  /// Discards the result because Q has new values.
  void forget() { state_ = State::unseen; }

 private:
  enum class State { unseen, unknown, convex, indefinite };

  const ScaledProblem& problem_;
  Kkt& kkt_;
  State state_ = State::unseen;
};

}  // namespace marble
