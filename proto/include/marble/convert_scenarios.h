// Conversions between messages and scenario solves. Arrays of incoming messages are viewed, not copied.
#pragma once

#include "marble/composite/scenario_samples.h"
#include "marble/composite/scenarios.h"
#include "marble/v1/scenarios.pb.h"
#include "marble/v1/service.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble {

/// Fills first_stage, own rows and the scenarios of a problem that has its base. Views the message's arrays.
/// Errors: fields of `Scenarios`, "samples.values" and such.
[[nodiscard]] Expected<void> take_scenarios(const v1::Scenarios& message, ScenarioProblem& problem);

/// Absent fields keep their value in `settings`; options and callback too. Checks nothing: check_scenarios
/// does, whose "settings.growth" is the field "growth" of the message.
void take_settings(const v1::Scenarios& message, ScenarioSettings& settings);

/// Copies the settings except options and callback.
void to_message(const ScenarioSettings& settings, v1::Scenarios* message);
/// Copies the problem's first stage and own rows, and its first `count` scenarios as a table of each entry
/// that differs from the base in any of them. Errors: those of `sample`, or of its results: "scenario[7].b".
[[nodiscard]] Expected<void> to_message(const ScenarioProblem& problem, std::int64_t count,
                                        v1::Scenarios* message);
/// Copies the sampler.
void to_message(const ScenarioSampler& sampler, v1::ScenarioSampler* message);

/// Copies everything except x.
void to_message(const SampleAverageStage& stage, v1::SampleAverageStage* message);
/// The inverse.
[[nodiscard]] SampleAverageStage sample_average_stage_of(const v1::SampleAverageStage& message);

/// Copies what the solution does not contain.
void to_message(const ScenarioSolution& answer, v1::ScenarioOutcome* message);
/// Returns the result in a solution, whose scenario outcome must be set.
[[nodiscard]] ScenarioSolution scenario_solution_of(const v1::Solution& message);

}  // namespace marble
