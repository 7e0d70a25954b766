// Solves by the published method that option `method` selects: from a start to where that method ends,
// without further steps.
#pragma once

#include <memory>

#include "marble/research/methods.h"
#include "path/reporter.h"
#include "research/reference_method.h"
#include "solver/reference_methods.h"

namespace marble {

class Reference final : public ReferenceSolve {
 public:
  Reference(const ScaledProblem& problem, Kkt& kkt, const Options& options, BranchEngines& branch);

  [[nodiscard]] Ending run(Run& run, ConstVectorRef initial_z) override;
  [[nodiscard]] const Iterate& iterate() const override { return x_; }

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
