// The two ways to solve a branch, exactly and elastically, from one point and with one factor.
#pragma once

#include "branch/elastic_relaxation.h"
#include "branch/exact_branch.h"

namespace marble {

struct BranchEngines {
  BranchEngines(const ScaledProblem& problem, Kkt& kkt)
      : point(problem, kkt),
        newton(problem, kkt, point),
        exact(point, newton),
        elastic(problem, point, newton) {}
  BranchEngines(const BranchEngines&) = delete;
  BranchEngines& operator=(const BranchEngines&) = delete;

  BranchPoint point;
  SemismoothNewton newton;
  ExactBranch exact;
  ElasticRelaxation elastic;
};

}  // namespace marble
