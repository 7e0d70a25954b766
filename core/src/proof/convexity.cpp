#include "proof/convexity.h"

#include <cmath>

#include "model/tuning.h"

namespace marble {
namespace {

bool diagonally_dominant(const ScaledProblem& p) {
  // Computed in the user's units, in which a row of (z₁ − z₂)² still adds up to 0.
  Vector off_diagonal = Vector::Zero(p.variables());
  Vector diagonal = Vector::Zero(p.variables());
  for (Index column = 0; column < p.Q.size; ++column) {
    for (Index k = p.Q.column_pointers[column]; k < p.Q.column_pointers[column + 1]; ++k) {
      const Index row = p.Q.row_indices[k];
      const double value = p.Q.values[k] / (p.variable_scale[row] * p.variable_scale[column]);
      if (row == column) {
        diagonal[row] = value;
      } else {
        off_diagonal[row] += std::abs(value);
        off_diagonal[column] += std::abs(value);
      }
    }
  }
  return (diagonal.array() * (1.0 + tuning::rounding) >= off_diagonal.array()).all();
}

bool convex_by_inertia(const ScaledProblem& p, Kkt& kkt) {
  RowWeights weights(p);
  weights.rho = tuning::rounding;
  weights.delta = tuning::exact_delta;
  return kkt.factor(weights);
}

}  // namespace

bool Convexity::known() {
  if (state_ == State::unseen) state_ = diagonally_dominant(problem_) ? State::convex : State::unknown;
  return state_ == State::convex;
}

bool Convexity::decide(Run& run) {
  if (known()) return true;
  if (state_ == State::unknown && run.nonconvex) state_ = State::indefinite;
  if (state_ == State::indefinite) return false;
  ++run.factorizations;
  const bool convex =
      run.timed(&Times::factorization_s, [this] { return convex_by_inertia(problem_, kkt_); });
  if (!convex && run.interrupted()) return false;  // undecided
  state_ = convex ? State::convex : State::indefinite;
  return convex;
}

}  // namespace marble
