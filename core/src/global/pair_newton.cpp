#include "global/pair_newton.h"

#include <limits>

#include "model/tuning.h"

namespace marble {

bool pair_newton_applies(const ScaledProblem& problem) {
  return problem.pairs() > 0 && problem.inequalities() == 0 &&
         problem.variables() == problem.equalities() + problem.pairs();
}

bool pair_newton(Run& run, const ScaledProblem& problem, BranchPoint& point) {
  const RowLayout& rows = problem.layout;
  double last = std::numeric_limits<double>::infinity();
  for (int step = 0; step < tuning::engine_budget && !run.interrupted(); ++step) {
    for (Index pair = 0; pair < rows.pairs; ++pair) point.set.held[point.set.free_row(pair)] = 0;
    point.set.clear_others(point.x.lambda());
    if (!point.factor(run, tuning::exact_rho, tuning::exact_delta) || !point.sharpen(tuning::rounding))
      return false;
    ++run.iterations;
    double negative = 0.0;
    for (Index pair = 0; pair < rows.pairs; ++pair) {
      const double side = point.images.rows.all[point.set.free_row(pair)];
      if (side >= -tuning::exactness) continue;
      negative -= side;
      point.set.switch_pair(pair);
    }
    if (negative == 0.0) return true;
    if (negative >= last) return false;
    last = negative;
  }
  return false;
}

}  // namespace marble
