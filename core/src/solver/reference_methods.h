// The published methods that option `method` offers, as the solver sees them: research/ implements them, in a
// library that only programs for comparisons link.
#pragma once

#include <memory>

#include "branch/branch_engines.h"
#include "path/termination.h"

namespace marble {

/// A solve by a published method in place of this solver's engines.
class ReferenceSolve {
 public:
  ReferenceSolve() = default;
  ReferenceSolve(const ReferenceSolve&) = delete;
  ReferenceSolve& operator=(const ReferenceSolve&) = delete;
  virtual ~ReferenceSolve() = default;

  /// Runs the selected method from z (scaled). Returns solved if the point is within the tolerances and
  /// stationary, almost_solved if it is within 100 times of them, and locally_infeasible if the largest
  /// penalty did not suffice.
  [[nodiscard]] virtual Ending run(Run& run, ConstVectorRef initial_z) = 0;
  /// Returns the final point, or the best point so far if the run was interrupted.
  [[nodiscard]] virtual const Iterate& iterate() const = 0;
};

class ReferenceMethods {
 public:
  ReferenceMethods() = default;
  ReferenceMethods(const ReferenceMethods&) = delete;
  ReferenceMethods& operator=(const ReferenceMethods&) = delete;
  virtual ~ReferenceMethods() = default;

  /// The solve works on `branch` if its method needs one. `options` may change from run to run.
  [[nodiscard]] virtual std::unique_ptr<ReferenceSolve> create(const ScaledProblem& problem, Kkt& kkt,
                                                               const Options& options,
                                                               BranchEngines& branch) const = 0;
  /// Returns the memory of one solve, for a problem with this many entries and an iterate of this length.
  [[nodiscard]] virtual double bytes(double entries, double iterate) const = 0;
};

}  // namespace marble
