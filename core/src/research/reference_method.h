// Common interface of the published methods that option `method` offers for comparison. Each runs in rounds
// from a start until it ends by its own rule; none of them polishes or searches.
#pragma once

#include <string>

#include "model/iterate.h"
#include "path/run.h"

namespace marble {

class ReferenceMethod {
 public:
  ReferenceMethod() = default;
  ReferenceMethod(const ReferenceMethod&) = delete;
  ReferenceMethod& operator=(const ReferenceMethod&) = delete;
  virtual ~ReferenceMethod() = default;

  enum class State {
    going_on,
    ended,     ///< by its own rule
    given_up,  ///< its penalty is at the maximum, and the pairs are not complementary yet
    failed,    ///< a subproblem has no solution or was not solved
  };
  /// Starts from z (scaled), with the current numbers of the problem.
  virtual void start(ConstVectorRef initial_z) = 0;
  /// Runs one round: a QP, a penalty's minimum, or a Newton step.
  [[nodiscard]] virtual State step(Run& run) = 0;

  /// z, y and λ; σ and v are not used.
  [[nodiscard]] virtual const Iterate& iterate() const = 0;
  /// Returns the penalty, or 0 if there is none.
  [[nodiscard]] virtual double penalty() const = 0;
  /// Returns the τ of s∘t ≤ τ or the μ of a barrier, or 0 if there is none.
  [[nodiscard]] virtual double relaxation() const { return 0.0; }
  /// Returns further information on how it ended, or an empty string.
  [[nodiscard]] virtual std::string remark() const { return {}; }
};

}  // namespace marble
