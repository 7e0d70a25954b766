// Begins a solve that goes on by itself.
#pragma once

#include <memory>

#include "connection.h"
#include "marble/options.h"
#include "marble/pending_solution.h"
#include "marble/problem.h"
#include "marble/solver.h"

namespace marble::client {

/// Errors: those of make_request and of the trace.
[[nodiscard]] Expected<PendingSolution> begin_solve(const std::shared_ptr<const Connection>& connection,
                                                    const ProblemView& problem, const Options& options,
                                                    const SolveControls& controls, const CallControls& call);

}  // namespace marble::client
