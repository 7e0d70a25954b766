#include "marble/composite/coupled_progress.h"

namespace marble {

Progress row_of(const CoupledIteration& iteration, double elapsed_s) {
  Progress row;
  row.iteration = row.outer_iteration = iteration.iteration;
  row.objective = iteration.objective;
  row.violations.equality = iteration.coupling_violation;
  row.kkt_residual = iteration.step;
  row.rho = iteration.proximal;
  row.factorizations = static_cast<std::int32_t>(iteration.factorizations);
  row.elapsed_s = elapsed_s;
  return row;
}

CoupledIteration coupled_iteration_of(const Progress& row) {
  return {.iteration = row.iteration,
          .coupling_violation = row.violations.equality,
          .step = row.kkt_residual,
          .objective = row.objective,
          .proximal = row.rho,
          .factorizations = row.factorizations};
}

}  // namespace marble
