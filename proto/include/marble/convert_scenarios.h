// The border between messages and scenario solves. Arrays are mapped, not copied, on the way in.
#pragma once

#include "marble/composite/scenarios.h"
#include "marble/composite/worlds.h"
#include "marble/v1/scenarios.pb.h"
#include "marble/v1/service.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble {

/// Fills first_stage, own rows and the worlds of a problem that has its base. Views the message's arrays.
/// Errors: fields of `Scenarios`, "samples.values" and such.
[[nodiscard]] Expected<void> take_worlds(const v1::Scenarios& message, ScenarioProblem& problem);

/// Absent fields keep their value in `settings`; options and callback too. Checks nothing: check_scenarios
/// does, whose "settings.growth" is the field "growth" here.
void take_settings(const v1::Scenarios& message, ScenarioSettings& settings);

/// The settings but for options and callback.
void to_message(const ScenarioSettings& settings, v1::Scenarios* message);
/// The problem's first stage and own rows, and as a table the first `count` of its worlds: of each entry that
/// is not the base's in all of them. Errors: those of `sample`, or of what it gives: "scenario[7].b".
[[nodiscard]] Expected<void> to_message(const ScenarioProblem& problem, std::int64_t count,
                                        v1::Scenarios* message);
/// The sampler.
void to_message(const ScenarioSampler& sampler, v1::ScenarioSampler* message);

/// Everything but x.
void to_message(const ScenarioLevel& level, v1::ScenarioLevel* message);
/// The way back.
[[nodiscard]] ScenarioLevel scenario_level_of(const v1::ScenarioLevel& message);

/// What the solution does not say.
void to_message(const ScenarioAnswer& answer, v1::ScenarioOutcome* message);
/// An answer from its solution, whose outcome must be there.
[[nodiscard]] ScenarioAnswer scenario_answer_of(const v1::Solution& message);

}  // namespace marble
