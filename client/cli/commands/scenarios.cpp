// Computes one plan for many scenarios and prints each sample-average stage.
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <deque>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "file_bytes.h"
#include "formats.h"
#include "marble/composite/scenario_samples.h"
#include "npz_problem.h"
#include "output/json.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

/// The content of a file, and the arrays that it borrows. Must not move.
struct ScenarioFile {
  ScenarioTable table;                                                          ///< from an .npz file
  ScenarioSampler sampler;                                                      ///< from a JSON file
  std::vector<Index> first_stage, own_equalities, own_inequalities, own_pairs;  ///< if the file has them
  std::deque<std::vector<double>> numbers;
  std::deque<std::vector<Index>> positions;
};

constexpr std::array<const char*, 11> kParts = {"c0", "g", "b", "d", "l", "r", "Q", "A", "C", "L", "R"};

std::optional<ProblemPart> part_of(std::string_view name) {
  for (std::size_t i = 0; i < kParts.size(); ++i)
    if (name == kParts[i]) return static_cast<ProblemPart>(i);
  return std::nullopt;
}

std::vector<Index>* list_of(ScenarioFile& file, std::string_view name) {
  if (name == "first_stage") return &file.first_stage;
  if (name == "own_equalities") return &file.own_equalities;
  if (name == "own_inequalities") return &file.own_inequalities;
  return name == "own_pairs" ? &file.own_pairs : nullptr;
}

Expected<Index> index_of(const std::string& field, double value) {
  constexpr double kMost = std::numeric_limits<Index>::max();
  if (value >= 0.0 && value <= kMost && value == std::floor(value)) return static_cast<Index>(value);
  return unexpected(invalid(field, "must hold whole numbers from 0 on"));
}

Expected<std::vector<Index>> indices_of(const std::string& field, const std::vector<double>& values) {
  std::vector<Index> result;
  for (const double value : values) {
    MARBLE_ASSIGN_OR_RETURN(const auto index, index_of(field, value));
    result.push_back(index);
  }
  return result;
}

// One array of an .npz file: a row for each scenario.
struct Columns {
  std::vector<double> values;
  std::size_t rows = 0, width = 0;
};

Expected<Columns> columns_of(const std::string& name, const formats::NpyArray& array) {
  if (array.shape.empty() || array.shape.size() > 2)
    return unexpected(invalid(name, "must have a row for each scenario"));
  Columns columns{array.values, array.shape[0], array.shape.size() < 2 ? 1 : array.shape[1]};
  if (columns.values.size() != columns.rows * columns.width)
    return unexpected(invalid(name, "must hold numbers"));
  if (array.column_major)
    for (std::size_t k = 0; k < columns.values.size(); ++k)
      columns.values[k] = array.values[k % columns.width * columns.rows + k / columns.width];
  return columns;
}

template <class Value>
Expected<Value> field_of(const nlohmann::json& object, const char* name, Value otherwise) {
  if (!object.contains(name)) return otherwise;
  try {
    return object.at(name).get<Value>();
  } catch (const nlohmann::json::exception&) {
    return unexpected(invalid(name, object.at(name).dump(), "is of the wrong type"));
  }
}

Expected<ScenarioQuantity> quantity_of(const nlohmann::json& object, ScenarioFile& file) {
  ScenarioQuantity quantity;
  MARBLE_ASSIGN_OR_RETURN(const auto word, field_of<std::string>(object, "distribution", "uniform"));
  if (word == "normal") {
    quantity.distribution = ScenarioDistribution::normal;
  } else if (word == "lognormal") {
    quantity.distribution = ScenarioDistribution::lognormal;
  } else if (word != "uniform") {
    return unexpected(invalid("distribution", word, "must be uniform, normal or lognormal"));
  }
  for (const auto& [name, into] : {std::pair{"location", &quantity.location},
                                   {"scale", &quantity.scale},
                                   {"least", &quantity.least},
                                   {"most", &quantity.most}}) {
    MARBLE_ASSIGN_OR_RETURN(*into, field_of(object, name, *into));
  }
  const auto effects = field_of(object, "effects", nlohmann::json::array());
  if (!effects || !effects->is_array()) return unexpected(invalid("effects", "must be a list"));
  for (const nlohmann::json& effect : *effects) {
    const auto name = field_of<std::string>(effect, "part", "");
    const auto part = name ? part_of(*name) : std::nullopt;
    if (!part) return unexpected(invalid("part", "must be one of c0, g, b, d, l, r, Q, A, C, L, R"));
    MARBLE_ASSIGN_OR_RETURN(const auto positions, field_of<std::vector<double>>(effect, "positions", {}));
    MARBLE_ASSIGN_OR_RETURN(auto places, indices_of("positions", positions));
    MARBLE_ASSIGN_OR_RETURN(auto gains, field_of<std::vector<double>>(effect, "gains", {1.0}));
    const auto& kept = file.positions.emplace_back(std::move(places));
    quantity.effects.push_back({{*part, kept}, file.numbers.emplace_back(std::move(gains))});
  }
  return quantity;
}

// Reads an .npz file: for every part that varies, c0, g, b, d, l, r, or the values of Q, A, C, L, R, one row
// per scenario; weights; first_stage, own_equalities, own_inequalities and own_pairs. Errors name the array.
Expected<void> read_samples(const std::string& path, ScenarioFile& file) {
  MARBLE_ASSIGN_OR_RETURN(const auto arrays, formats::read_npz_arrays(path));
  std::vector<Columns> parts;
  for (const auto& [name, array] : arrays) {
    if (std::vector<Index>* const list = list_of(file, name)) {
      MARBLE_ASSIGN_OR_RETURN(*list, indices_of(name, array.values));
    } else if (name == "weights") {
      file.table.weights = file.numbers.emplace_back(array.values);
    } else if (const auto part = part_of(name)) {
      MARBLE_ASSIGN_OR_RETURN(auto columns, columns_of(name, array));
      if (!parts.empty() && columns.rows != parts.front().rows)
        return unexpected(invalid(name, std::to_string(columns.rows) + " rows",
                                  "must have a row for each scenario, as others have"));
      file.table.entries.push_back({*part, {}});
      parts.push_back(std::move(columns));
    } else {
      return unexpected(invalid(name,
                                "is no array of samples: c0, g, b, d, l, r, Q, A, C, L, R, weights, "
                                "first_stage, own_equalities, own_inequalities or own_pairs"));
    }
  }
  std::vector<double>& values = file.numbers.emplace_back();
  for (std::size_t i = 0; !parts.empty() && i < parts.front().rows; ++i)
    for (const Columns& part : parts) {
      const auto row = part.values.begin() + static_cast<std::ptrdiff_t>(i * part.width);
      values.insert(values.end(), row, row + static_cast<std::ptrdiff_t>(part.width));
    }
  file.table.values = values;
  return {};
}

// Reads a JSON file: {"seed": 7, "quantities": [{"distribution": "normal", "location": 0, "scale": 1,
// "least": -2, "most": 2, "effects": [{"part": "l", "positions": [0, 1], "gains": [1.0]}]}], "first_stage":
// …}.
Expected<void> read_sampler(const std::string& path, ScenarioFile& file) {
  MARBLE_ASSIGN_OR_RETURN(const auto bytes, formats::read_bytes(path));
  MARBLE_ASSIGN_OR_RETURN(const auto content, parsed_object(bytes));
  for (const char* const name : {"first_stage", "own_equalities", "own_inequalities", "own_pairs"}) {
    MARBLE_ASSIGN_OR_RETURN(const auto values, field_of<std::vector<double>>(content, name, {}));
    MARBLE_ASSIGN_OR_RETURN(auto indices, indices_of(name, values));
    *list_of(file, name) = std::move(indices);
  }
  MARBLE_ASSIGN_OR_RETURN(file.sampler.seed, field_of<std::uint64_t>(content, "seed", 0));
  const auto quantities = field_of(content, "quantities", nlohmann::json::array());
  if (!quantities || !quantities->is_array()) return unexpected(invalid("quantities", "must be a list"));
  for (std::size_t q = 0; q < quantities->size(); ++q) {
    auto quantity = quantity_of(quantities->at(q), file);
    if (!quantity) return unexpected(inside("quantities[" + std::to_string(q) + "]", quantity.error()));
    file.sampler.quantities.push_back(*std::move(quantity));
  }
  return {};
}

// Parses "0-3,7": ascending numbers and ranges.
Expected<std::vector<Index>> parse_indices(const std::string& text) {
  std::vector<Index> result;
  const auto refuse = [&] {
    return unexpected(invalid("--first-stage", text, "must be numbers and ranges such as 0-3,7"));
  };
  const auto number = [](std::string_view word) -> std::optional<Index> {
    Index value = 0;
    const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (fault != std::errc() || end != word.data() + word.size() || value < 0) return std::nullopt;
    return value;
  };
  constexpr Index kLongestRange = 1 << 28;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    const std::string_view word = std::string_view(text).substr(at, comma - at);
    const std::size_t dash = word.find('-');
    const auto first = number(word.substr(0, dash));
    const auto last = dash == std::string_view::npos ? first : number(word.substr(dash + 1));
    if (!first || !last || *last < *first || *last - *first > kLongestRange) return refuse();
    for (Index i = *first; i <= *last; ++i) result.push_back(i);
    at = comma + 1;
  }
  return result;
}

struct ScenarioArguments {
  std::string base, samples, sampler, first_stage;
  ServerArguments server;
  SolverArguments solver;
  ScenarioSettings settings;
  Priority priority = Priority::by_method;
};

int file_fails(const std::string& path, const Error& error) {
  complain(path, error.message());
  return exit_code_of_local(error);
}

Json out_of_sample_json(const OutOfSample& out_of_sample) {
  return {{"scenarios", out_of_sample.scenarios},
          {"infeasible", out_of_sample.infeasible},
          {"mean", out_of_sample.mean},
          {"half_width", std::isfinite(out_of_sample.half_width) ? Json(out_of_sample.half_width) : Json()},
          {"factorizations", out_of_sample.factorizations}};
}

Json stage_json(const SampleAverageStage& stage) {
  return {{"stage", stage.stage},
          {"scenarios", stage.scenarios},
          {"status", to_string(stage.status)},
          {"objective", stage.objective},
          {"factorizations", stage.factorizations},
          {"seconds", stage.seconds},
          {"warm", stage.warm},
          {"searched", stage.searched},
          {"out_of_sample", stage.out_of_sample ? out_of_sample_json(*stage.out_of_sample) : Json()}};
}

void report_stage(const ScenarioArguments& arguments, const SampleAverageStage& stage) {
  if (arguments.server.json()) {
    std::cout << line(stage_json(stage)) << '\n' << std::flush;
    return;
  }
  if (stage.stage == 0)
    std::printf("%7s %-14s %15s %31s %9s %8s %8s\n", "scenarios", "status", "value",
                "in other scenarios, 95 %", "no way", "fact", "s");
  std::string others, no_way;
  if (stage.out_of_sample) {
    char text[64];
    std::snprintf(text, sizeof text, "%.7g +- %.3g", stage.out_of_sample->mean,
                  stage.out_of_sample->half_width);
    others = text;
    no_way = std::to_string(stage.out_of_sample->infeasible) + "/" +
             std::to_string(stage.out_of_sample->scenarios);
  }
  std::printf("%7lld %-14s %15.7e %31s %9s %8lld %8.3f\n", static_cast<long long>(stage.scenarios),
              to_string(stage.status), stage.objective, others.c_str(), no_way.c_str(),
              static_cast<long long>(stage.factorizations), stage.seconds);
  std::fflush(stdout);
}

void report_answer(const ScenarioArguments& arguments, const RemoteScenarios& answer) {
  if (arguments.server.json()) {
    std::cout << line({{"file", arguments.base},
                       {"job_id", answer.job_id},
                       {"end", to_string(answer.end)},
                       {"status", to_string(answer.status)},
                       {"detail", answer.detail},
                       {"scenarios", answer.scenarios},
                       {"objective", answer.scenarios > 0 ? Json(answer.objective) : Json()},
                       {"infeasible", answer.infeasible},
                       {"factorizations", answer.solution.factorizations},
                       {"x", answer.x}})
              << '\n'
              << std::flush;
    return;
  }
  std::printf(
      "%s: %s; the plan is for %lld scenarios, objective %.10g, largest violation %.1e\n%s\n",
      to_string(answer.end), to_string(answer.status), static_cast<long long>(answer.scenarios),
      answer.objective,
      std::max({answer.violations.equality, answer.violations.inequality, answer.violations.complementarity}),
      without_controls(answer.detail).c_str());
}

int run(ScenarioArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  arguments.settings.options = *options;
  const auto base = formats::read_any_problem(arguments.base);
  if (!base) return file_fails(arguments.base, base.error());
  const bool sampled = !arguments.sampler.empty();
  const std::string& scenarios = sampled ? arguments.sampler : arguments.samples;
  ScenarioFile file;
  auto read = sampled ? read_sampler(scenarios, file) : read_samples(scenarios, file);
  if (!read) return file_fails(scenarios, read.error());
  if (!arguments.first_stage.empty()) {
    auto plan = parse_indices(arguments.first_stage);
    if (!plan) return option_fails(plan.error());
    file.first_stage = *std::move(plan);
  }
  ScenarioProblem problem;
  problem.base = base->problem.view();
  problem.first_stage = file.first_stage;
  problem.own_equalities = file.own_equalities;
  problem.own_inequalities = file.own_inequalities;
  problem.own_pairs = file.own_pairs;
  const auto set = sampled ? set_scenarios(problem, file.sampler) : set_scenarios(problem, file.table);
  if (!set) return file_fails(scenarios, set.error());
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  arguments.settings.stage = [&](const SampleAverageStage& stage) { report_stage(arguments, stage); };
  CallControls call;
  call.problem_name = base->problem.name;
  call.priority = arguments.priority;
  const SolveControls controls{.stop = interrupt.token()};
  const auto answer = sampled
                          ? client->solve_scenarios(problem, file.sampler, arguments.settings, controls, call)
                          : client->solve_scenarios(problem, arguments.settings, controls, call);
  if (!answer) return server_fails(arguments.server, answer.error());
  report_answer(arguments, *answer);
  return is_solved(answer->status) ? kAllSolved : kNotSolved;
}

}  // namespace

void add_scenarios(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<ScenarioArguments>();
  CLI::App* command = program.add_subcommand(
      "scenarios", "Solve a two-stage stochastic LCQP by sample average approximation");
  command
      ->add_option("FILE", arguments->base,
                   "base problem, over the first-stage variables and the recourse variables of one scenario")
      ->required();
  auto* samples =
      command->add_option("--samples", arguments->samples,
                          ".npz file with one row per scenario for each part that varies (c0, g, b, d, l, r, "
                          "or the values of Q, A, C, L, R), and optionally weights and first_stage");
  command
      ->add_option("--sampler", arguments->sampler,
                   "JSON file that describes the random numbers and the data they change; the solver draws "
                   "the scenarios")
      ->excludes(samples);
  command->add_option("--first-stage", arguments->first_stage,
                      "first-stage variables, such as 0-3,7; needed where the file does not name them");
  add_server_arguments(*command, arguments->server);
  add_priority_argument(*command, arguments->priority);
  add_solver_arguments(*command, arguments->solver);
  ScenarioSettings& settings = arguments->settings;
  command
      ->add_option("--initial-sample-size", settings.initial_sample_size,
                   "number of scenarios of the first stage of the approximation")
      ->capture_default_str();
  command->add_option("--growth", settings.growth, "factor by which each stage has more scenarios")
      ->capture_default_str();
  command->add_option("--max-sample-size", settings.max_sample_size, "largest number of scenarios")
      ->capture_default_str();
  command
      ->add_option("--tolerance", settings.tolerance,
                   "stop when the 95 % confidence interval of the out-of-sample cost is at most this "
                   "fraction of the cost; 0: never")
      ->capture_default_str();
  command
      ->add_option("--min-sample-size", settings.min_sample_size,
                   "smallest number of scenarios at which --tolerance may stop")
      ->capture_default_str();
  command
      ->add_option("--out-of-sample-scenarios", settings.out_of_sample_scenarios,
                   "number of out-of-sample scenarios that evaluate a plan")
      ->capture_default_str();
  command->footer(kExitCodes);
  command->callback([arguments, &exit_code] {
    if (arguments->samples.empty() && arguments->sampler.empty())
      throw CLI::RequiredError("--samples or --sampler");
    exit_code = run(*arguments);
  });
}

}  // namespace marble::cli
