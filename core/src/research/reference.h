// Solves by the published method that option `method` selects: from a start to where that method ends,
// without further steps.
#pragma once

#include <memory>

#include "branch/branch_engines.h"
#include "path/reporter.h"
#include "path/termination.h"
#include "research/reference_method.h"

namespace marble {

class Reference {
 public:
  /// Works on `branch` if a method needs one.
  Reference(const ScaledProblem& problem, Kkt& kkt, const Options& options, BranchEngines& branch);

  /// Runs the selected method from z (scaled). Returns solved if the point is within the tolerances and
  /// stationary, almost_solved if it is within 100 times of them, and locally_infeasible if the largest
  /// penalty did not suffice.
  [[nodiscard]] Ending run(Run& run, ConstVectorRef initial_z);
  /// Returns the final point, or the best point so far if the run was interrupted.
  [[nodiscard]] const Iterate& iterate() const { return x_; }

  /// Returns the memory of one object, for a problem with this many entries and an iterate of this length.
  [[nodiscard]] static double bytes(double entries, double iterate);

 private:
  void take(const Iterate& x);
  [[nodiscard]] Ending judge(ReferenceMethod::State state) const;

  const ScaledProblem& problem_;
  Kkt& kkt_;
  const Options& options_;
  BranchEngines& branch_;
  std::unique_ptr<ReferenceMethod> method_;
  Method made_ = Method::marble;  // the method that method_ implements
  Iterate x_, best_;
  Images images_;
  Violations violations_, best_violations_;
  Reporter reporter_;
};

}  // namespace marble
