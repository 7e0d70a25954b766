// What the methods of others have in common that option `method` puts beside this solver: rounds from a point
// to where the method itself ends. None of them polishes or searches.
#pragma once

#include <string>

#include "data/iterate.h"
#include "run/run.h"

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
    given_up,  ///< its penalty is as large as it may be, and the pairs are not complementary yet
    failed,    ///< a problem on the way has no solution, or was not solved
  };
  /// From z (scaled), of the numbers that the problem has now.
  virtual void start(ConstVectorRef initial_z) = 0;
  /// One round: a QP, a penalty's minimum, a Newton step.
  [[nodiscard]] virtual State step(Run& run) = 0;

  /// z, y and λ; σ and v are not used.
  [[nodiscard]] virtual const Iterate& iterate() const = 0;
  /// The penalty, 0 where there is none.
  [[nodiscard]] virtual double penalty() const = 0;
  /// The τ of s∘t ≤ τ or the μ of a barrier, 0 where there is none.
  [[nodiscard]] virtual double relaxation() const { return 0.0; }
  /// What else there is to say of where it ended; empty where there is nothing.
  [[nodiscard]] virtual std::string remark() const { return {}; }
};

}  // namespace marble
