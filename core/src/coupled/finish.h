// What comes after the blocks: their answers as one, and the exact solve that begins there.
#pragma once

#include "marble/composite/coupled.h"

namespace marble {

/// Whether a set-up was ended by a caller's stop or the time limit: the solve then has an answer that says
/// so.
[[nodiscard]] inline bool ends_early(const Error& error) {
  return error.code == ErrorCode::cancelled || error.code == ErrorCode::deadline_exceeded;
}
/// Whether a caller's stop or the time limit ended it.
[[nodiscard]] bool stopped(const Coordination& coordination);
/// Σ f_k(y_k)
[[nodiscard]] double sum_of_objectives(const Coordination& coordination);
/// The problem, solved from what the blocks have found: `start` has z and multipliers of its sizes.
[[nodiscard]] Expected<Solution> solve_from(const Problem& problem, Solution start,
                                            const Coordination& coordination, const CoupledOptions& options,
                                            const CoupledControls& controls);

}  // namespace marble
