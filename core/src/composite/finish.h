// Joins the blocks' solutions into one and runs the exact solve that starts there.
#pragma once

#include <cstdint>

#include "marble/composite/coupled.h"
#include "model/interrupt.h"

namespace marble {

/// True if the caller's stop or the time limit ended a set-up. The solve then returns a solution with that
/// status.
[[nodiscard]] inline bool ends_early(const Error& error) {
  return error.code == ErrorCode::cancelled || error.code == ErrorCode::deadline_exceeded;
}
/// Returns the interrupt that ends a coupled solve.
[[nodiscard]] inline Interrupt interrupt_of(const CoupledControls& controls, const Options& options) {
  const auto never = Interrupt::Clock::time_point::max();
  const auto until = controls.begun ? after(*controls.begun, options.time_limit_s) : never;
  return Interrupt(controls.stop, until, controls.pause);
}
/// The same, for solvers and derivatives that are set up within the memory of `controls`.
[[nodiscard]] inline SetupControls setup_of(const CoupledControls& controls, const Options& options) {
  SetupControls setup = controls.setup;
  setup.stop = controls.stop;
  setup.pause = controls.pause;
  setup.until = SetupControls().until;
  if (controls.begun) setup.until = after(*controls.begun, options.time_limit_s);
  return setup;
}
/// Subtracts `bytes` from the memory that the controls allow. Errors: resource_exhausted with this field.
[[nodiscard]] Expected<void> charge(CoupledControls& controls, std::int64_t bytes, const char* field);
/// Returns the bytes of a copy of a problem.
[[nodiscard]] std::int64_t copy_bytes(const ProblemView& problem);
/// True if the caller's stop or the time limit ended the coordination.
[[nodiscard]] bool stopped(const Coordination& coordination);
/// Σ f_k(y_k)
[[nodiscard]] double sum_of_objectives(const Coordination& coordination);
/// Solves the problem from the blocks' result: `start` has z and multipliers of its sizes.
[[nodiscard]] Expected<Solution> solve_from(const Problem& problem, Solution start,
                                            const Coordination& coordination, const CoupledOptions& options,
                                            const CoupledControls& controls);

}  // namespace marble
