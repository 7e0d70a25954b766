// Solves a coupled problem, or a long horizon in pieces, on one server.
#pragma once

#include <span>

#include "connection/connection.h"
#include "marble/call_controls.h"
#include "marble/coupled.h"

namespace marble::client {

[[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled_remotely(const Connection& connection,
                                                                     const CoupledView& view,
                                                                     const CoupledOptions& options,
                                                                     const CoupledControls& controls,
                                                                     const CallControls& call);

[[nodiscard]] Expected<RemotePiecesSolution> solve_in_pieces_remotely(
    const Connection& connection, const Problem& problem, std::span<const Index> stage_of_variable,
    const PiecesOptions& options, const CoupledControls& controls, const CallControls& call);

}  // namespace marble::client
