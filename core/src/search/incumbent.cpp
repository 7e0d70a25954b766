#include "search/incumbent.h"

#include <cmath>
#include <limits>
#include <utility>

#include "model/tuning.h"
#include "path/termination.h"

namespace marble {

bool solve_exactly(const ScaledProblem& problem, const Options& options, ExactBranch& branch, Run& run,
                   int budget, ExactSolution& solution, Parametric* parametric) {
  const bool solved = branch.solve(run, budget, parametric);
  solution.violations = violations(problem, branch.point().images);
  if (!solved || !within_tolerances(solution.violations, options)) return false;
  solution.x.all = branch.point().x.all;
  solution.set = branch.point().set;
  solution.converged = branch.point().converged();
  solution.objective = branch.point().images.objective;
  return true;
}

Incumbent::Incumbent(const ScaledProblem& problem, const Options& options, ExactBranch& branch)
    : problem_(problem), options_(options), branch_(branch), best_(problem), other_(problem) {}

Incumbent::Outcome Incumbent::solve_branch(Run& run, const char* origin, int budget, Parametric* parametric) {
  if (!solve_exactly(problem_, options_, branch_, run, budget, other_, parametric)) return Outcome::not_exact;
  const double least_gain = tuning::rounding * std::abs(best_.objective);
  if (exists_ && other_.objective >= best_.objective - least_gain) return Outcome::no_better;
  other_.origin = origin;
  replace(other_);
  return Outcome::kept;
}

// Tries the rows with a few factorizations as soon as they have settled, and with the full budget at the end.
bool Incumbent::solve_branch(Run& run, QuadraticEngine& engine) {
  return engine.find_rows(run, run.factorizations + tuning::engine_budget, [&](int budget) {
    const Run::Polishing polishing(run);
    branch_.point().restore(engine.iterate(), engine.set());
    return solve_branch(run, "interior point", budget) == Outcome::kept;
  });
}

void Incumbent::offer(const Iterate& x, const Images& images, const WorkingSet& set, const char* origin) {
  if (exists_ && !(images.objective < best_.objective)) return;
  other_.violations = violations(problem_, images);
  if (!within_tolerances(other_.violations, options_)) return;
  other_.x.all = x.all;
  other_.set = set;
  other_.converged = true;
  other_.objective = images.objective;
  other_.origin = origin;
  replace(other_);
}

bool Incumbent::doubles_hold(ConstVectorRef z) const {
  const double rounding =
      std::numeric_limits<double>::epsilon() * max_abs(z.cwiseProduct(problem_.variable_scale));
  return rounding <= options_.complementarity_tolerance;
}

void Incumbent::replace(ExactSolution& better) {
  std::swap(best_, better);
  exists_ = true;
}

}  // namespace marble
