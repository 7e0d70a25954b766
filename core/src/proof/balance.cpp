#include "proof/balance.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"

namespace marble {
namespace {

void raise_terms(const RowMatrix& matrix, ConstVectorRef multipliers, Vector& largest) {
  for (Index row = 0; row < matrix.rows; ++row)
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      double& term = largest[matrix.column_indices[k]];
      term = std::max(term, std::abs(matrix.values[k] * multipliers[row]));
    }
}

Vector largest_terms(const ScaledProblem& p, const Iterate& x) {
  Vector largest = p.g.cwiseAbs();
  for (Index j = 0; j < p.Q.size; ++j)
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const Index i = p.Q.row_indices[k];
      largest[i] = std::max(largest[i], std::abs(p.Q.values[k] * x.z()[j]));
      largest[j] = std::max(largest[j], std::abs(p.Q.values[k] * x.z()[i]));
    }
  raise_terms(p.A, x.y(), largest);
  raise_terms(p.rows, x.lambda(), largest);
  return largest;
}

}  // namespace

bool is_balanced(const ScaledProblem& p, const Options& options, const Images& images, const Iterate& x) {
  const double least =
      std::max(tuning::reduced_residual, tuning::reduced_factor * options.stationarity_tolerance);
  if (max_abs(images.stationarity) <= least) return true;
  const Vector largest = largest_terms(p, x);
  for (Eigen::Index j = 0; j < largest.size(); ++j)
    if (!(std::abs(images.stationarity[j]) <= std::max(least, tuning::near * largest[j]))) return false;
  return true;
}

bool is_balanced_in_user_units(const ScaledProblem& p, const Images& images, const Iterate& x) {
  const Vector to_user = (p.cost_scale * p.variable_scale).cwiseInverse();
  const Vector residual = images.stationarity.cwiseProduct(to_user).cwiseAbs();
  if (max_abs(residual) <= tuning::first_digit) return true;
  const Vector largest = largest_terms(p, x).cwiseProduct(to_user);
  return (residual.array() <= tuning::first_digit * (1.0 + largest.array())).all();
}

}  // namespace marble
