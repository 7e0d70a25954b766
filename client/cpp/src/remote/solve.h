// Runs one solve: a unary call, or a stream if events are requested.
#pragma once

#include "connection/connection.h"
#include "marble/call_controls.h"
#include "marble/solver.h"

namespace marble::client {

[[nodiscard]] Expected<RemoteSolution> solve_remotely(const Connection& connection,
                                                      const ProblemView& problem, const Options& options,
                                                      const SolveControls& controls,
                                                      const CallControls& call);

}  // namespace marble::client
