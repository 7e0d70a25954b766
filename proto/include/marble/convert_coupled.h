// Conversions between messages and coupled solves. Arrays of incoming messages are viewed, not copied.
#pragma once

#include "marble/composite/coupled.h"
#include "marble/composite/segments.h"
#include "marble/v1/coupled.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble {

/// Returns the blocks and the coupling right-hand side. Views the message's arrays, and checks nothing.
[[nodiscard]] CoupledView coupled_of(const v1::Coupled& message);
/// The inverse.
void to_message(const CoupledView& view, v1::Coupled* message);

/// Absent fields keep their value in `settings`; solver options too. Checks nothing: CoupledOptions::check
/// does.
void take_settings(const v1::Coupled& message, CoupledOptions& settings);
/// Copies all of them except the solver options.
void to_message(const CoupledOptions& settings, v1::Coupled* message);

/// Copies everything except the blocks' own solutions.
void to_message(const Coordination& coordination, double blocks_objective, v1::CoupledOutcome* message);
/// The inverse.
[[nodiscard]] Coordination coordination_of(const v1::CoupledOutcome& message);

/// Converts a path of the core to one of a request, from its `coupled` on: "blocks[1].problem.A.values" is
/// "coupled.blocks[1].problem.equality_matrix.values".
[[nodiscard]] std::string coupled_message_field(const std::string& core_field);
/// The inverse; other fields stay.
[[nodiscard]] std::string coupled_core_field(const std::string& message_field);

}  // namespace marble
