#include "composite/stage_bytes.h"

#include "solver/solver_bytes.h"

namespace marble {

double bytes_of(const ScenarioNumbers& numbers) {
  std::size_t count = 0;
#define MARBLE_VECTOR(letter, field) count += numbers.letter.capacity();
#define MARBLE_MATRIX(letter, field, values, vector) count += numbers.letter.capacity();
#include "marble/contract.def"
  return static_cast<double>(sizeof(ScenarioNumbers) + count * sizeof(double));
}

double stage_bytes(const Stages& stages, double scenarios, double scenario_bytes, const Options& options) {
  return scenarios * (scenario_bytes + 2.0 * stages.part_bytes() + sizeof(double)) +
         stages.assembled_bytes(scenarios) + 2.0 * stages.answer_bytes(scenarios) +
         least_solver_bytes(stages.assembled_sizes(scenarios), options);
}

}  // namespace marble
