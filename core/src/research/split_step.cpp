#include "research/split_step.h"

#include <algorithm>

#include "research/newton_system.h"
#include "research/tuning.h"

namespace marble {

SplitStep::SplitStep(const ScaledProblem& problem, Kkt& kkt, const Options& options)
    : curvature(split_size(problem.layout)),
      slope(curvature.size()),
      coupling(problem.pairs()),
      product(problem.pairs()),
      z_step(problem.variables()),
      y_step(problem.equalities()),
      step(curvature.size()),
      multiplier(problem.pairs()),
      problem_(problem),
      kkt_(kkt),
      options_(options),
      weights_(problem),
      rhs_(problem.layout),
      weight_(problem.pairs()) {}

// dq = (π − f)/h and dm = (−π − f)/h, each with its own f and h, for the multiplier π. So π = W(t ds + s dt)
// + the constant part, which is stored in `multiplier` here.
void SplitStep::weigh(const Images& at) {
  const Index rows = problem_.layout.size(), pairs = problem_.pairs();
  weights_.rho = tuning::interior_rho;
  weights_.delta = std::max(tuning::exact_delta, delta_);
  weights_.rows.all = curvature.head(rows);
  rhs_.all = slope.head(rows);
  for (Index i = 0; i < pairs; ++i) {
    const Index q = rows + i, m = rows + pairs + i;
    const double s = at.rows.s()[i], t = at.rows.t()[i];
    weight_[i] = 1.0 / (1.0 / curvature[q] + 1.0 / curvature[m]);
    multiplier[i] = weight_[i] * (product[i] + slope[q] / curvature[q] - slope[m] / curvature[m]);
    PairBlock(s, t, weights_.rows.s()[i], weights_.rows.t()[i], coupling[i], weight_[i]).put(i, weights_);
    rhs_.s()[i] += t * multiplier[i];
    rhs_.t()[i] += s * multiplier[i];
  }
}

bool SplitStep::solve(Run& run, const Images& at) {
  const double first_delta = options_.regularization_initial;
  if (!factor_regularized(run, kkt_, weights_, first_delta, delta_, [&] { weigh(at); })) return false;
  z_step = at.stationarity;
  add_transposed(problem_.rows, rhs_.all, z_step);
  z_step = -z_step;
  y_step = -at.equality;
  if (!kkt_.solve(z_step, y_step) || !z_step.allFinite() || !y_step.allFinite()) return false;
  const Index rows = problem_.layout.size(), pairs = problem_.pairs();
  multiply(problem_.rows, z_step, step.head(rows));
  for (Index i = 0; i < pairs; ++i) {
    const Index q = rows + i, m = rows + pairs + i;
    multiplier[i] += weight_[i] * (at.rows.t()[i] * step[problem_.layout.s(i)] +
                                   at.rows.s()[i] * step[problem_.layout.t(i)]);
    step[q] = (multiplier[i] - slope[q]) / curvature[q];
    step[m] = (-multiplier[i] - slope[m]) / curvature[m];
  }
  return true;
}

}  // namespace marble
