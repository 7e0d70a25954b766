#include "support/other_units.h"

namespace marble::testing {
namespace {

void convert_rows(SparseMatrix& matrix, std::vector<double>& constants, const std::vector<double>& variables,
                  const OtherUnits& units) {
  std::vector<double> rows(constants.size());
  for (double& factor : rows) factor = units.row();
  for (std::size_t i = 0; i < rows.size(); ++i) constants[i] *= rows[i];
  for (Index j = 0; j < matrix.columns; ++j) {
    for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k)
      matrix.values[k] *= rows[matrix.row_indices[k]] * variables[j];
  }
}

}  // namespace

Converted convert(OwnedProblem p, const OtherUnits& units) {
  std::vector<double> variables(p.g.size());
  for (double& factor : variables) factor = units.variable();
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k)
      p.Q.values[k] *= units.cost * variables[j] * variables[p.Q.row_indices[k]];
  }
  for (std::size_t j = 0; j < variables.size(); ++j) p.g[j] *= units.cost * variables[j];
  p.c0 *= units.cost;
  convert_rows(p.A, p.b, variables, units);
  convert_rows(p.C, p.d, variables, units);
  convert_rows(p.L, p.l, variables, units);
  convert_rows(p.R, p.r, variables, units);
  return {std::move(p), std::move(variables)};
}

}  // namespace marble::testing
