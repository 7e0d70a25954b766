// The two ways to solve a branch, exactly and elastically, from one point and with one factor, and what both
// use.
#pragma once

#include "branch/elastic_relaxation.h"
#include "branch/exact_branch.h"

namespace marble {

struct BranchEngines {
  BranchEngines(const ScaledProblem& problem, Kkt& kkt)
      : point(problem, kkt),
        newton(problem, kkt, point),
        interior(problem, kkt),
        exact(point, newton, interior),
        elastic(problem, point, newton, interior) {}
  BranchEngines(const BranchEngines&) = delete;
  BranchEngines& operator=(const BranchEngines&) = delete;

  BranchPoint point;
  SemismoothNewton newton;
  QuadraticEngine interior;
  ExactBranch exact;
  ElasticRelaxation elastic;
};

}  // namespace marble
