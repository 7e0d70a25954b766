// A long horizon window by window: each is solved by itself from where the last one ended, with some stages
// ahead of those that it decides.
#pragma once

#include "marble/composite/pieces.h"

namespace marble {

/// z and multipliers of the whole, feasible where the status says solved; else that of the window that was
/// not, whose name begins the detail. Not stationary: windows know nothing of those behind them.
[[nodiscard]] Expected<Solution> sweep(const Problem& problem, std::span<const Index> stage_of_variable,
                                       std::span<const Index> piece_of_variable, const PiecesOptions& options,
                                       const CoupledControls& controls);

}  // namespace marble
