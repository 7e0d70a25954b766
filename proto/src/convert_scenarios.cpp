#include "marble/convert_scenarios.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "marble/convert.h"

namespace marble {
namespace {

template <class Field>
auto span_of(const Field& field) {
  return std::span(field.data(), static_cast<std::size_t>(field.size()));
}

std::vector<Index> list_of(const google::protobuf::RepeatedField<std::int32_t>& field) {
  return {field.begin(), field.end()};
}

static_assert(static_cast<int>(ProblemPart::R) + 1 == v1::PROBLEM_PART_RIGHT_VALUES &&
                  static_cast<int>(ProblemPart::Q) + 1 == v1::PROBLEM_PART_HESSIAN_VALUES,
              "both enumerations list the parts in the same order");
static_assert(static_cast<int>(ScenarioDistribution::lognormal) + 1 ==
                  v1::ScenarioQuantity::DISTRIBUTION_LOGNORMAL,
              "the enums count alike");
static_assert(static_cast<int>(ScenarioEnd::cancelled) + 1 == v1::SCENARIO_END_CANCELLED,
              "the enums count alike");

Expected<ScenarioEntries> entries_of(const v1::ScenarioEntries& message, const std::string& name) {
  if (message.part() < v1::PROBLEM_PART_CONSTANT || message.part() > v1::PROBLEM_PART_RIGHT_VALUES)
    return unexpected(invalid(name + ".part", std::to_string(message.part()), "must be in [1, 11]"));
  return ScenarioEntries{static_cast<ProblemPart>(message.part() - v1::PROBLEM_PART_CONSTANT),
                         span_of(message.positions())};
}

Expected<ScenarioTable> table_of(const v1::ScenarioSamples& message) {
  ScenarioTable table{.values = span_of(message.values()), .weights = span_of(message.weights())};
  for (int e = 0; e < message.entries_size(); ++e) {
    MARBLE_ASSIGN_OR_RETURN(auto entries,
                            entries_of(message.entries(e), "samples.entries[" + std::to_string(e) + "]"));
    table.entries.push_back(entries);
  }
  return table;
}

Expected<ScenarioSampler> sampler_of(const v1::ScenarioSampler& message) {
  ScenarioSampler sampler{.seed = message.seed()};
  for (int q = 0; q < message.quantities_size(); ++q) {
    const v1::ScenarioQuantity& given = message.quantities(q);
    const std::string name = "sampler.quantities[" + std::to_string(q) + "]";
    if (given.distribution() < 0 || given.distribution() > v1::ScenarioQuantity::DISTRIBUTION_LOGNORMAL)
      return unexpected(
          invalid(name + ".distribution", std::to_string(given.distribution()), "must be in [0, 3]"));
    ScenarioQuantity quantity{.location = given.location()};
    if (given.distribution() != v1::ScenarioQuantity::DISTRIBUTION_UNSPECIFIED)
      quantity.distribution = static_cast<ScenarioDistribution>(given.distribution() -
                                                                v1::ScenarioQuantity::DISTRIBUTION_UNIFORM);
    if (given.has_scale()) quantity.scale = given.scale();
    if (given.has_least()) quantity.least = given.least();
    if (given.has_most()) quantity.most = given.most();
    for (int e = 0; e < given.effects_size(); ++e) {
      MARBLE_ASSIGN_OR_RETURN(
          const auto entries,
          entries_of(given.effects(e).entries(), name + ".effects[" + std::to_string(e) + "].entries"));
      quantity.effects.push_back({entries, span_of(given.effects(e).gains())});
    }
    sampler.quantities.push_back(std::move(quantity));
  }
  return sampler;
}

void entries_to_message(const ScenarioEntries& entries, v1::ScenarioEntries* message) {
  message->set_part(static_cast<v1::ProblemPart>(static_cast<int>(entries.part) + v1::PROBLEM_PART_CONSTANT));
  message->mutable_positions()->Assign(entries.positions.begin(), entries.positions.end());
}

// A part's numbers in each scenario; those of the base where a scenario has none.
struct Column {
  ProblemPart part;
  std::span<const double> base;
  std::vector<double> ScenarioNumbers::*numbers;
};

}  // namespace

Expected<void> take_scenarios(const v1::Scenarios& message, ScenarioProblem& problem) {
  problem.first_stage = list_of(message.first_stage());
  problem.own_equalities = list_of(message.own_equalities());
  problem.own_inequalities = list_of(message.own_inequalities());
  problem.own_pairs = list_of(message.own_pairs());
  switch (message.scenarios_case()) {
    case v1::Scenarios::kSamples: {
      const auto table = table_of(message.samples());
      return table ? set_scenarios(problem, *table) : unexpected(table.error());
    }
    case v1::Scenarios::kSampler: {
      const auto sampler = sampler_of(message.sampler());
      return sampler ? set_scenarios(problem, *sampler) : unexpected(sampler.error());
    }
    case v1::Scenarios::SCENARIOS_NOT_SET:
      break;
  }
  return unexpected(invalid("samples", "or a sampler must be there"));
}

void take_settings(const v1::Scenarios& message, ScenarioSettings& settings) {
  if (message.has_initial_sample_size()) settings.initial_sample_size = message.initial_sample_size();
  if (message.has_growth()) settings.growth = message.growth();
  if (message.has_max_sample_size()) settings.max_sample_size = message.max_sample_size();
  if (message.has_tolerance()) settings.tolerance = message.tolerance();
  if (message.has_min_sample_size()) settings.min_sample_size = message.min_sample_size();
  if (message.has_max_infeasible_fraction())
    settings.max_infeasible_fraction = message.max_infeasible_fraction();
  if (message.has_out_of_sample_scenarios())
    settings.out_of_sample_scenarios = message.out_of_sample_scenarios();
}

void to_message(const ScenarioSettings& settings, v1::Scenarios* message) {
  message->set_initial_sample_size(settings.initial_sample_size);
  message->set_growth(settings.growth);
  message->set_max_sample_size(settings.max_sample_size);
  message->set_tolerance(settings.tolerance);
  message->set_min_sample_size(settings.min_sample_size);
  message->set_max_infeasible_fraction(settings.max_infeasible_fraction);
  message->set_out_of_sample_scenarios(settings.out_of_sample_scenarios);
}

Expected<void> to_message(const ScenarioProblem& problem, std::int64_t count, v1::Scenarios* message) {
  message->mutable_first_stage()->Assign(problem.first_stage.begin(), problem.first_stage.end());
  message->mutable_own_equalities()->Assign(problem.own_equalities.begin(), problem.own_equalities.end());
  message->mutable_own_inequalities()->Assign(problem.own_inequalities.begin(),
                                              problem.own_inequalities.end());
  message->mutable_own_pairs()->Assign(problem.own_pairs.begin(), problem.own_pairs.end());
  const auto base = Problem::create(problem.base);
  if (!base) return unexpected(inside("base", base.error()));
  if (!problem.sample) return unexpected(invalid("sample", "must be there"));
  const PartSizes sizes = PartSizes::of(*base);
  const ProblemView& view = problem.base;
  std::vector<ScenarioNumbers> scenarios;
  bool constant = false, weights = false;
  for (std::int64_t i = 0; i < std::min(count, problem.scenarios); ++i) {
    MARBLE_ASSIGN_OR_RETURN(auto scenario, problem.sample(i));
    if (auto valid = sizes.check(scenario.update()); !valid)
      return unexpected(inside("scenario[" + std::to_string(i) + "]", valid.error()));
    constant = constant || scenario.c0.value_or(view.c0) != view.c0;
    weights = weights || scenario.weight != 1.0;
    scenarios.push_back(std::move(scenario));
  }
  using enum ProblemPart;
  using N = ScenarioNumbers;
  const std::array columns = {Column{g, view.g, &N::g},        Column{b, view.b, &N::b},
                              Column{d, view.d, &N::d},        Column{l, view.l, &N::l},
                              Column{r, view.r, &N::r},        Column{Q, view.Q.values, &N::Q},
                              Column{A, view.A.values, &N::A}, Column{C, view.C.values, &N::C},
                              Column{L, view.L.values, &N::L}, Column{R, view.R.values, &N::R}};
  v1::ScenarioSamples* samples = message->mutable_samples();
  std::vector<std::pair<const Column*, std::vector<Index>>> differing;
  if (constant) entries_to_message({c0, {}}, samples->add_entries());
  for (const Column& column : columns) {
    std::vector<Index> positions;
    for (std::size_t k = 0; k < column.base.size(); ++k)
      if (std::ranges::any_of(scenarios, [&](const ScenarioNumbers& scenario) {
            const std::vector<double>& numbers = scenario.*column.numbers;
            return !numbers.empty() && numbers[k] != column.base[k];
          }))
        positions.push_back(static_cast<Index>(k));
    if (positions.empty()) continue;
    entries_to_message({column.part, positions}, samples->add_entries());
    differing.emplace_back(&column, std::move(positions));
  }
  for (const ScenarioNumbers& scenario : scenarios) {
    if (constant) samples->add_values(scenario.c0.value_or(view.c0));
    if (weights) samples->add_weights(scenario.weight);
    for (const auto& [column, positions] : differing) {
      const std::vector<double>& numbers = scenario.*column->numbers;
      for (const Index k : positions)
        samples->add_values(numbers.empty() ? column->base[static_cast<std::size_t>(k)]
                                            : numbers[static_cast<std::size_t>(k)]);
    }
  }
  return {};
}

void to_message(const ScenarioSampler& sampler, v1::ScenarioSampler* message) {
  message->set_seed(sampler.seed);
  for (const ScenarioQuantity& quantity : sampler.quantities) {
    v1::ScenarioQuantity* into = message->add_quantities();
    into->set_distribution(static_cast<v1::ScenarioQuantity::Distribution>(
        static_cast<int>(quantity.distribution) + v1::ScenarioQuantity::DISTRIBUTION_UNIFORM));
    into->set_location(quantity.location);
    into->set_scale(quantity.scale);
    into->set_least(quantity.least);
    into->set_most(quantity.most);
    for (const auto& [entries, gains] : quantity.effects) {
      v1::ScenarioEffect* effect = into->add_effects();
      entries_to_message(entries, effect->mutable_entries());
      effect->mutable_gains()->Assign(gains.begin(), gains.end());
    }
  }
}

void to_message(const SampleAverageStage& stage, v1::SampleAverageStage* message) {
  message->set_stage(stage.stage);
  message->set_scenarios(stage.scenarios);
  message->set_status(to_message(stage.status));
  message->set_detail(stage.detail);
  message->set_objective(stage.objective);
  message->set_variables(stage.variables);
  message->set_pairs(stage.pairs);
  message->set_factorizations(stage.factorizations);
  message->set_seconds(stage.seconds);
  message->set_warm(stage.warm);
  message->set_searched(stage.searched);
  message->set_memory_bytes(stage.memory_bytes);
  if (!stage.out_of_sample) return;
  v1::OutOfSample* out_of_sample = message->mutable_out_of_sample();
  out_of_sample->set_scenarios(stage.out_of_sample->scenarios);
  out_of_sample->set_infeasible(stage.out_of_sample->infeasible);
  out_of_sample->set_mean(stage.out_of_sample->mean);
  out_of_sample->set_half_width(stage.out_of_sample->half_width);
  out_of_sample->set_factorizations(stage.out_of_sample->factorizations);
  out_of_sample->set_seconds(stage.out_of_sample->seconds);
}

SampleAverageStage sample_average_stage_of(const v1::SampleAverageStage& message) {
  SampleAverageStage stage{.stage = message.stage(),
                           .scenarios = message.scenarios(),
                           .status = status_of(message.status()),
                           .detail = message.detail(),
                           .objective = message.objective(),
                           .variables = message.variables(),
                           .pairs = message.pairs(),
                           .factorizations = message.factorizations(),
                           .seconds = message.seconds(),
                           .warm = message.warm(),
                           .searched = message.searched(),
                           .memory_bytes = message.memory_bytes()};
  if (!message.has_out_of_sample()) return stage;
  const v1::OutOfSample& out_of_sample = message.out_of_sample();
  stage.out_of_sample = {out_of_sample.scenarios(),  out_of_sample.infeasible(),     out_of_sample.mean(),
                         out_of_sample.half_width(), out_of_sample.factorizations(), out_of_sample.seconds()};
  return stage;
}

void to_message(const ScenarioSolution& answer, v1::ScenarioOutcome* message) {
  message->set_end(static_cast<v1::ScenarioEnd>(static_cast<int>(answer.end) + v1::SCENARIO_END_INTERVAL));
  message->set_scenarios(answer.scenarios);
  message->set_first_stage(static_cast<std::int32_t>(answer.x.size()));
  message->mutable_infeasible()->Assign(answer.infeasible.begin(), answer.infeasible.end());
  for (const SampleAverageStage& stage : answer.stages) to_message(stage, message->add_stages());
}

ScenarioSolution scenario_solution_of(const v1::Solution& message) {
  const v1::ScenarioOutcome& outcome = message.scenarios();
  ScenarioSolution answer;
  const int end = outcome.end() - v1::SCENARIO_END_INTERVAL;
  const bool known = end >= 0 && end <= static_cast<int>(ScenarioEnd::cancelled);
  answer.end = known ? static_cast<ScenarioEnd>(end) : ScenarioEnd::not_solved;
  answer.solution = solution_of(message);
  answer.status = answer.solution.status;
  answer.detail = answer.solution.detail;
  answer.objective = answer.solution.objective;
  answer.violations = answer.solution.violations;
  answer.scenarios = outcome.scenarios();
  answer.infeasible.assign(outcome.infeasible().begin(), outcome.infeasible().end());
  for (const v1::SampleAverageStage& stage : outcome.stages())
    answer.stages.push_back(sample_average_stage_of(stage));
  const std::vector<double>& z = answer.solution.z;
  const std::size_t plan = std::min(z.size(), static_cast<std::size_t>(std::max(outcome.first_stage(), 0)));
  answer.x.assign(z.begin(), z.begin() + static_cast<std::ptrdiff_t>(plan));
  const auto scenarios = static_cast<std::size_t>(std::max<std::int64_t>(answer.scenarios, 0));
  if (scenarios == 0 || scenarios > z.size()) return answer;
  const std::size_t own = (z.size() - plan) / scenarios;
  for (std::size_t s = 0; s < scenarios; ++s) {
    const auto first = z.begin() + static_cast<std::ptrdiff_t>(plan + s * own);
    answer.recourse.emplace_back(first, first + static_cast<std::ptrdiff_t>(own));
  }
  return answer;
}

}  // namespace marble
