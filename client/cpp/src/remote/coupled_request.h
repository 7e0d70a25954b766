// What a coupled solve sends, and its answer.
#pragma once

#include <span>

#include "marble/call_controls.h"
#include "marble/coupled.h"
#include "marble/v1/service.pb.h"

namespace marble::client {

/// Of the controls the start counts; error where it has more than prices.
[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const CoupledView& view,
                                                            const CoupledOptions& options,
                                                            const CoupledControls& controls,
                                                            const CallControls& call);

[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const Problem& problem,
                                                            std::span<const Index> stage_of_variable,
                                                            const PiecesOptions& options,
                                                            const CallControls& call);

/// Errors: failed_precondition where the problem was solved alone; "blocks", whose sizes are not the
/// answer's.
[[nodiscard]] Expected<RemoteCoupledSolution> remote_coupled(const v1::SolveResponse& response,
                                                             const CoupledView& view);

/// Errors: failed_precondition where the problem was solved alone.
[[nodiscard]] Expected<RemotePiecesSolution> remote_pieces(const v1::SolveResponse& response);

}  // namespace marble::client
