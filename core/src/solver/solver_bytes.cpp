#include "solver/solver_bytes.h"

#include <algorithm>
#include <limits>

#include "branch/parametric.h"
#include "model/tuning.h"
#include "search/further_starts.h"
#include "search/penalty_homotopy.h"
#include "solver/reference_methods.h"

namespace marble {

double least_solver_bytes(const SolverSizes& sizes, const Options& options, const ReferenceMethods* methods) {
  const double rows = sizes.inequalities + 2.0 * sizes.pairs;
  const double iterate = sizes.variables + sizes.equalities + 2.0 * sizes.inequalities + 3.0 * sizes.pairs;
  const auto pairs =
      static_cast<Index>(std::min(sizes.pairs, static_cast<double>(std::numeric_limits<Index>::max())));
  const double bytes =
      sizes.entries * (sizeof(double) + 2.0 * sizeof(Index)) +
      tuning::memory_iterates * iterate * sizeof(double) + Parametric::response_bytes(pairs, rows) +
      (options.method != Method::marble ? methods->bytes(sizes.entries, iterate) : 0.0) +
      (PenaltyHomotopy::applies(pairs) ? PenaltyHomotopy::bytes(sizes.entries, iterate) : 0.0) +
      tuning::memory_fixed_bytes;
  return bytes + FurtherStarts::extra_bytes(options, bytes);
}

}  // namespace marble
