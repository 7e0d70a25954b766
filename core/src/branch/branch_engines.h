// Provides the two ways to solve a branch, exact and elastic, on one shared point and factor, and the engines
// that both use.
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
