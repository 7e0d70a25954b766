// What comes after the blocks: their answers as one, and the exact solve that begins there.
#pragma once

#include <cstdint>

#include "data/interrupt.h"
#include "marble/composite/coupled.h"

namespace marble {

/// Whether a set-up was ended by a caller's stop or the time limit: the solve then has an answer that says
/// so.
[[nodiscard]] inline bool ends_early(const Error& error) {
  return error.code == ErrorCode::cancelled || error.code == ErrorCode::deadline_exceeded;
}
/// What ends a coupled solve.
[[nodiscard]] inline Interrupt interrupt_of(const CoupledControls& controls, const Options& options) {
  return controls.begun ? Interrupt(controls.stop, after(*controls.begun, options.time_limit_s))
                        : Interrupt(controls.stop);
}
/// The same, for solvers and derivatives that are set up within the memory of `controls`.
[[nodiscard]] inline SetupControls setup_of(const CoupledControls& controls, const Options& options) {
  SetupControls setup = controls.setup;
  setup.stop = controls.stop;
  setup.until = SetupControls().until;
  if (controls.begun) setup.until = after(*controls.begun, options.time_limit_s);
  return setup;
}
/// Takes `bytes` from what the controls allow. Errors: resource_exhausted of the field.
[[nodiscard]] Expected<void> charge(CoupledControls& controls, std::int64_t bytes, const char* field);
/// Bytes of a copy of a problem.
[[nodiscard]] std::int64_t copy_bytes(const ProblemView& problem);
/// Whether a caller's stop or the time limit ended it.
[[nodiscard]] bool stopped(const Coordination& coordination);
/// Σ f_k(y_k)
[[nodiscard]] double sum_of_objectives(const Coordination& coordination);
/// The problem, solved from what the blocks have found: `start` has z and multipliers of its sizes.
[[nodiscard]] Expected<Solution> solve_from(const Problem& problem, Solution start,
                                            const Coordination& coordination, const CoupledOptions& options,
                                            const CoupledControls& controls);

}  // namespace marble
