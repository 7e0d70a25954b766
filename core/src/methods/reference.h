// A solve by the method of others that option `method` chooses: from a point to where that method ends, and
// nothing more.
#pragma once

#include <memory>

#include "branch/branch_engines.h"
#include "methods/reference_method.h"
#include "run/reporter.h"
#include "run/termination.h"

namespace marble {

class Reference {
 public:
  /// Works on `branch` where a method needs one.
  Reference(const ScaledProblem& problem, Kkt& kkt, const Options& options, BranchEngines& branch);

  /// From z (scaled) by the method that the options name now. Solved: within the tolerances, and stationary;
  /// solved_reduced within 100 times of them; locally_infeasible where the penalty grew in vain.
  [[nodiscard]] Ending run(Run& run, ConstVectorRef initial_z);
  /// Where it ended: the best point on the way if it was interrupted.
  [[nodiscard]] const Iterate& iterate() const { return x_; }

  /// Memory of one, for a problem with so many entries and an iterate of this length.
  [[nodiscard]] static double bytes(double entries, double iterate);

 private:
  void take(const Iterate& x);
  [[nodiscard]] Ending judge(ReferenceMethod::State state) const;

  const ScaledProblem& problem_;
  Kkt& kkt_;
  const Options& options_;
  BranchEngines& branch_;
  std::unique_ptr<ReferenceMethod> method_;
  Method made_ = Method::marble;  // what method_ is
  Iterate x_, best_;
  Images images_;
  Violations violations_, best_violations_;
  Reporter reporter_;
};

}  // namespace marble
