#include "research/quadratic_penalty.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "path/termination.h"
#include "research/tuning.h"

namespace marble {

void PiecewisePenalty::start(ConstVectorRef z) {
  branch_.point.set = WorkingSet(problem_);
  branch_.point.start_from_point(z);
  branch_.newton.center.all.setZero();
  branch_.newton.center.z() = z;
}

// The proximal term, which matters only where Q is flat, is centred at the start. Without estimates this is
// the branch's elastic problem, which has an interior point method in case Newton's method takes too many
// steps.
bool PiecewisePenalty::minimize(Run& run, double rho) {
  branch_.newton.center.z() = branch_.point.x.z();
  const auto estimates = branch_.newton.center.lambda();
  if (max_abs(branch_.newton.center.y()) == 0.0 && max_abs(estimates) == 0.0) {
    branch_.elastic.anchor_here();
    return branch_.elastic.solve(run, rho, ElasticRelaxation::Rows::violated, tuning::reference_budget);
  }
  return branch_.newton.minimize(run, {rho, tuning::elastic_delta},
                                 run.factorizations + tuning::reference_budget);
}

// On the branch s = 0 a pair costs s² + min(0, t)², both shifted, so the smaller side is nearer. A tie
// changes nothing.
bool PiecewisePenalty::choose_sides(double rho) {
  BranchPoint& point = branch_.point;
  const RowLayout& layout = problem_.layout;
  const auto estimate = branch_.newton.center.lambda();
  bool changed = false;
  for (Index i = 0; i < layout.pairs; ++i) {
    const auto shifted = [&](Index row) { return point.images.rows.all[row] + estimate[row] / rho; };
    const double lead = shifted(point.set.fixed_row(i)) - shifted(point.set.free_row(i));
    if (lead <= tuning::exactness || shifted(point.set.fixed_row(i)) <= 0.0) continue;
    point.set.switch_pair(i);
    changed = true;
  }
  return changed;
}

double PiecewisePenalty::violation(double rho) const {
  const Iterate& alpha = branch_.newton.center;
  const Iterate& x = branch_.point.x;
  double largest = 0.0;
  for (Index i = 0; i < problem_.equalities(); ++i)
    largest = std::max(largest, std::abs(x.y()[i] - alpha.y()[i]));
  for (Index row = 0; row < problem_.layout.size(); ++row)
    largest = std::max(largest, std::abs(x.lambda()[row] - alpha.lambda()[row]));
  return largest / rho;
}

void PiecewisePenalty::take_estimates() {
  branch_.newton.center.y() = branch_.point.x.y();
  branch_.newton.center.lambda() = branch_.point.x.lambda();
}

void ExteriorPenalty::start(ConstVectorRef initial_z) {
  penalty_ = tuning::reference_first;
  piece_.start(initial_z);
}

ReferenceMethod::State ExteriorPenalty::step(Run& run) {
  if (!piece_.minimize(run, 2.0 * penalty_)) return State::failed;
  ++run.iterations;
  if (piece_.choose_sides(2.0 * penalty_)) return State::going_on;
  if (within_tolerances(piece_.user_violations(), options_)) return State::ended;
  if (penalty_ >= tuning::reference_most) return State::given_up;
  penalty_ *= tuning::reference_factor;
  return State::going_on;
}

void AugmentedLagrangian::start(ConstVectorRef initial_z) {
  penalty_ = tuning::reference_first;
  violation_ = std::numeric_limits<double>::infinity();
  piece_.start(initial_z);
}

ReferenceMethod::State AugmentedLagrangian::step(Run& run) {
  if (!piece_.minimize(run, 2.0 * penalty_)) return State::failed;
  ++run.iterations;
  if (piece_.choose_sides(2.0 * penalty_)) return State::going_on;
  const double violation = piece_.violation(2.0 * penalty_);
  if (violation <= tuning::exactness) return State::ended;
  if (violation <= tuning::alag_fall * violation_) {
    violation_ = violation;
    piece_.take_estimates();
    return State::going_on;
  }
  if (penalty_ >= tuning::reference_most) return State::given_up;
  penalty_ *= tuning::reference_factor;
  return State::going_on;
}

}  // namespace marble
