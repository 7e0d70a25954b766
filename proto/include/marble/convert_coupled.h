// The border between messages and coupled solves. Arrays are mapped, not copied, on the way in.
#pragma once

#include "marble/composite/coupled.h"
#include "marble/composite/pieces.h"
#include "marble/v1/coupled.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble {

/// The blocks and their total. Views the message's arrays, and checks nothing.
[[nodiscard]] CoupledView coupled_of(const v1::Coupled& message);
/// The way there.
void to_message(const CoupledView& view, v1::Coupled* message);

/// Absent fields keep their value in `settings`; solver options too. Checks nothing: CoupledOptions::check
/// does.
void take_settings(const v1::Coupled& message, CoupledOptions& settings);
/// All of them but the solver options.
void to_message(const CoupledOptions& settings, v1::Coupled* message);

/// Everything but the blocks' own answers.
void to_message(const Coordination& coordination, double blocks_objective, v1::CoupledOutcome* message);
/// The way back.
[[nodiscard]] Coordination coordination_of(const v1::CoupledOutcome& message);

/// A path of core's as a request's message has it, from its `coupled` on: "blocks[1].problem.A.values" is
/// "coupled.blocks[1].problem.equality_matrix.values".
[[nodiscard]] std::string coupled_message_field(const std::string& core_field);
/// The way back; other fields stay.
[[nodiscard]] std::string coupled_core_field(const std::string& message_field);

}  // namespace marble
