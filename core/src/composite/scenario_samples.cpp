#include "marble/composite/scenario_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "composite/stages.h"
#include "marble/composite/counter_random.h"
#include "model/text_of.h"

namespace marble {
namespace {

constexpr std::array kParts = {
    &ScenarioNumbers::g, &ScenarioNumbers::b, &ScenarioNumbers::d, &ScenarioNumbers::l, &ScenarioNumbers::r,
    &ScenarioNumbers::Q, &ScenarioNumbers::A, &ScenarioNumbers::C, &ScenarioNumbers::L, &ScenarioNumbers::R};

std::span<const double> base_of(const ProblemView& base, ProblemPart part) {
  const std::array<std::span<const double>, kParts.size()> parts = {
      base.g,        base.b,        base.d,        base.l,        base.r,
      base.Q.values, base.A.values, base.C.values, base.L.values, base.R.values};
  return part == ProblemPart::c0 ? std::span(&base.c0, 1) : parts[static_cast<std::size_t>(part) - 1];
}

std::size_t size_of(const ProblemView& base, const ScenarioEntries& entries) {
  return entries.positions.empty() ? base_of(base, entries.part).size() : entries.positions.size();
}

// Calls `visit(k, number)` with a reference to each entry's number in a scenario.
template <class Visit>
void each_number(const ProblemView& base, const ScenarioEntries& entries, ScenarioNumbers& scenario,
                 const Visit& visit) {
  if (entries.part == ProblemPart::c0) {
    if (!scenario.c0) scenario.c0 = base.c0;
    visit(std::size_t{0}, *scenario.c0);
    return;
  }
  std::vector<double>& numbers = scenario.*kParts[static_cast<std::size_t>(entries.part) - 1];
  const std::span<const double> from = base_of(base, entries.part);
  if (numbers.empty()) numbers.assign(from.begin(), from.end());
  for (std::size_t k = 0; k < size_of(base, entries); ++k)
    visit(k, numbers[entries.positions.empty() ? k : static_cast<std::size_t>(entries.positions[k])]);
}

Expected<void> check_finite(std::span<const double> values, const std::string& field) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i]))
      return unexpected(invalid(field, static_cast<std::int64_t>(i), text_of(values[i]), "must be finite"));
  return {};
}

Expected<void> check_size(std::size_t size, std::size_t wanted, const std::string& field) {
  if (size == wanted) return {};
  return unexpected(invalid(field, std::to_string(size) + " entries", "must have " + std::to_string(wanted)));
}

Expected<void> check_table(const ProblemView& base, const ScenarioTable& table) {
  std::size_t width = 0;
  std::array<std::vector<char>, kParts.size() + 1> named;
  for (std::size_t e = 0; e < table.entries.size(); ++e) {
    const ScenarioEntries& entries = table.entries[e];
    std::vector<char>& marks = named[static_cast<std::size_t>(entries.part)];
    marks.resize(base_of(base, entries.part).size());
    for (std::size_t k = 0; k < size_of(base, entries); ++k) {
      char& mark = marks[entries.positions.empty() ? k : static_cast<std::size_t>(entries.positions[k])];
      if (std::exchange(mark, 1) != 0)
        return unexpected(invalid("samples.entries[" + std::to_string(e) + "].positions",
                                  static_cast<std::int64_t>(k), "", "names an entry a second time"));
    }
    width += size_of(base, entries);
  }
  if (width == 0) return unexpected(invalid("samples.entries", "must name an entry at least"));
  const std::size_t count = table.values.size() / width;
  if (count == 0 || table.values.size() % width != 0)
    return unexpected(invalid("samples.values", std::to_string(table.values.size()) + " entries",
                              "must have a row of " + std::to_string(width) + " for each of the scenarios"));
  MARBLE_RETURN_IF_ERROR(check_finite(table.values, "samples.values"));
  if (table.weights.empty()) return {};
  MARBLE_RETURN_IF_ERROR(check_size(table.weights.size(), count, "samples.weights"));
  for (std::size_t i = 0; i < count; ++i)
    if (!std::isfinite(table.weights[i]) || table.weights[i] <= 0.0)
      return unexpected(invalid("samples.weights", static_cast<std::int64_t>(i), text_of(table.weights[i]),
                                "must be finite and > 0"));
  return {};
}

Expected<void> check_quantity(const ProblemView& base, const ScenarioQuantity& quantity,
                              const std::string& name) {
  if (!std::isfinite(quantity.location))
    return unexpected(invalid(name + ".location", text_of(quantity.location), "must be finite"));
  if (!std::isfinite(quantity.scale) || quantity.scale < 0.0)
    return unexpected(invalid(name + ".scale", text_of(quantity.scale), "must be finite and >= 0"));
  if (std::isnan(quantity.least))
    return unexpected(invalid(name + ".least", text_of(quantity.least), "must be a number"));
  if (!(quantity.most >= quantity.least))
    return unexpected(invalid(name + ".most", text_of(quantity.most), "must be >= least"));
  if (quantity.effects.empty()) return unexpected(invalid(name + ".effects", "must be one at least"));
  for (std::size_t e = 0; e < quantity.effects.size(); ++e) {
    const ScenarioQuantity::Effect& effect = quantity.effects[e];
    const std::string field = name + ".effects[" + std::to_string(e) + "].gains";
    if (effect.gains.size() != 1)
      MARBLE_RETURN_IF_ERROR(check_size(effect.gains.size(), size_of(base, effect.entries), field));
    MARBLE_RETURN_IF_ERROR(check_finite(effect.gains, field));
  }
  return {};
}

// Checks the entries with the check of the patterns, which requires a sample function.
Expected<void> check_entries(ScenarioProblem& problem,
                             std::span<const std::pair<ScenarioEntries, std::string>> named) {
  problem.scenarios = 1;
  problem.sample = [](std::int64_t) { return Expected<ScenarioNumbers>(); };
  MARBLE_ASSIGN_OR_RETURN(const auto stages, Stages::create(problem));
  for (const auto& one : named) {
    const ScenarioEntries& entries = one.first;
    const std::string& name = one.second;
    const std::span<const double> part = base_of(problem.base, entries.part);
    if (part.empty()) return unexpected(invalid(name + ".part", "must be a part that the base has"));
    for (std::size_t k = 0; k < entries.positions.size(); ++k) {
      const Index at = entries.positions[k];
      const auto refuse = [&](const std::string& bound) {
        return unexpected(
            invalid(name + ".positions", static_cast<std::int64_t>(k), std::to_string(at), bound));
      };
      if (at < 0 || static_cast<std::size_t>(at) >= part.size())
        return refuse("must be in [0, " + std::to_string(part.size()) + ")");
      if (k > 0 && at <= entries.positions[k - 1]) return refuse("must be above the entry before it");
    }
    if (const auto fixed = stages.fixed_among(entries); fixed)
      return unexpected(invalid(name + ".positions", static_cast<std::int64_t>(*fixed), "",
                                "is of a row of first-stage variables alone; name the row in "
                                "own_equalities, own_inequalities or own_pairs"));
  }
  return {};
}

}  // namespace

double scenario_draw(const ScenarioQuantity& quantity, std::uint64_t seed, std::int64_t scenario,
                     std::uint32_t place) {
  const CounterRandom random(seed);
  const auto sample = static_cast<std::uint64_t>(scenario);
  double number = random.uniform(sample, 2 * place);
  if (quantity.distribution != ScenarioDistribution::uniform) {
    const double angle = 2.0 * std::numbers::pi * random.uniform(sample, 2 * place + 1);
    number = std::sqrt(-2.0 * std::log1p(-number)) * std::cos(angle);
  }
  number = quantity.location + quantity.scale * number;
  if (quantity.distribution == ScenarioDistribution::lognormal) number = std::exp(number);
  return std::clamp(number, quantity.least, quantity.most);
}

Expected<void> set_scenarios(ScenarioProblem& problem, const ScenarioTable& table) {
  std::vector<std::pair<ScenarioEntries, std::string>> named;
  for (std::size_t e = 0; e < table.entries.size(); ++e)
    named.emplace_back(table.entries[e], "samples.entries[" + std::to_string(e) + "]");
  MARBLE_RETURN_IF_ERROR(check_entries(problem, named));
  MARBLE_RETURN_IF_ERROR(check_table(problem.base, table));
  std::size_t width = 0;
  for (const ScenarioEntries& entries : table.entries) width += size_of(problem.base, entries);
  problem.scenarios = static_cast<std::int64_t>(table.values.size() / width);
  problem.sample = [base = problem.base, table, width](std::int64_t i) -> Expected<ScenarioNumbers> {
    ScenarioNumbers scenario;
    const auto number = static_cast<std::size_t>(i);
    auto row = table.values.subspan(number * width, width);
    for (const ScenarioEntries& entries : table.entries) {
      each_number(base, entries, scenario, [&](std::size_t k, double& value) { value = row[k]; });
      row = row.subspan(size_of(base, entries));
    }
    if (!table.weights.empty()) scenario.weight = table.weights[number];
    return scenario;
  };
  return {};
}

Expected<void> set_scenarios(ScenarioProblem& problem, const ScenarioSampler& sampler) {
  if (sampler.quantities.empty()) return unexpected(invalid("sampler.quantities", "must be one at least"));
  std::vector<std::pair<ScenarioEntries, std::string>> named;
  for (std::size_t q = 0; q < sampler.quantities.size(); ++q)
    for (std::size_t e = 0; e < sampler.quantities[q].effects.size(); ++e)
      named.emplace_back(
          sampler.quantities[q].effects[e].entries,
          "sampler.quantities[" + std::to_string(q) + "].effects[" + std::to_string(e) + "].entries");
  MARBLE_RETURN_IF_ERROR(check_entries(problem, named));
  for (std::size_t q = 0; q < sampler.quantities.size(); ++q)
    MARBLE_RETURN_IF_ERROR(
        check_quantity(problem.base, sampler.quantities[q], "sampler.quantities[" + std::to_string(q) + "]"));
  problem.scenarios = std::numeric_limits<std::int64_t>::max();
  problem.sample = [base = problem.base, sampler](std::int64_t i) -> Expected<ScenarioNumbers> {
    ScenarioNumbers scenario;
    for (std::size_t q = 0; q < sampler.quantities.size(); ++q) {
      const ScenarioQuantity& quantity = sampler.quantities[q];
      const double number = scenario_draw(quantity, sampler.seed, i, static_cast<std::uint32_t>(q));
      for (const ScenarioQuantity::Effect& effect : quantity.effects)
        each_number(base, effect.entries, scenario, [&](std::size_t k, double& value) {
          value += number * effect.gains[effect.gains.size() == 1 ? 0 : k];
        });
    }
    return scenario;
  };
  return {};
}

}  // namespace marble
