#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "answers.h"
#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "marble/composite/scenario_samples.h"

namespace marble::python {
namespace {

// Uses the field names of a request's message: "settings.growth" is "scenarios.growth".
Error named(Error error) {
  constexpr std::string_view kSettings = "settings.";
  if (error.field.starts_with(kSettings)) error.field.erase(0, kSettings.size());
  return inside("scenarios", std::move(error));
}

ScenarioEntries entries_of(Borrowed& arrays, const py::handle& part, const py::handle& positions) {
  return {static_cast<ProblemPart>(part.cast<int>()), arrays.indices(positions)};
}

ScenarioDistribution distribution_of(const std::string& name) {
  if (name == "uniform") return ScenarioDistribution::uniform;
  if (name == "normal") return ScenarioDistribution::normal;
  if (name == "lognormal") return ScenarioDistribution::lognormal;
  raise(invalid("distribution", name, "must be uniform, normal or lognormal"));
}

// Both borrow arrays.
ScenarioTable table_of(Borrowed& arrays, const py::tuple& given) {
  ScenarioTable table{.values = arrays.doubles(given[1]), .weights = arrays.doubles(given[2])};
  for (const py::handle entry : given[0]) {
    const auto named_entry = entry.cast<py::tuple>();
    table.entries.push_back(entries_of(arrays, named_entry[0], named_entry[1]));
  }
  return table;
}

ScenarioSampler sampler_of(Borrowed& arrays, const py::tuple& given) {
  ScenarioSampler sampler{.seed = given[0].cast<std::uint64_t>()};
  for (const py::handle one : given[1]) {
    const auto parts = one.cast<py::tuple>();
    ScenarioQuantity& quantity = sampler.quantities.emplace_back();
    quantity.distribution = distribution_of(parts[0].cast<std::string>());
    quantity.location = parts[1].cast<double>();
    quantity.scale = parts[2].cast<double>();
    quantity.least = parts[3].cast<double>();
    quantity.most = parts[4].cast<double>();
    for (const py::handle effect : parts[5]) {
      const auto moved = effect.cast<py::tuple>();
      quantity.effects.push_back({entries_of(arrays, moved[0], moved[1]), arrays.doubles(moved[2])});
    }
  }
  return sampler;
}

ScenarioSettings settings_of(const py::dict& given) {
  ScenarioSettings settings;
  settings.initial_sample_size = given["initial_sample_size"].cast<std::int64_t>();
  settings.growth = given["growth"].cast<double>();
  settings.max_sample_size = given["max_sample_size"].cast<std::int64_t>();
  settings.tolerance = given["tolerance"].cast<double>();
  settings.min_sample_size = given["min_sample_size"].cast<std::int64_t>();
  settings.max_infeasible_fraction = given["max_infeasible_fraction"].cast<double>();
  settings.out_of_sample_scenarios = given["out_of_sample_scenarios"].cast<std::int64_t>();
  return settings;
}

py::dict dict_of(const SampleAverageStage& l) {
  py::dict stage;
  stage["stage"] = l.stage, stage["scenarios"] = l.scenarios;
  stage["status"] = to_string(l.status), stage["detail"] = l.detail;
  stage["objective"] = l.objective;
  stage["variables"] = l.variables, stage["pairs"] = l.pairs;
  stage["factorizations"] = l.factorizations, stage["seconds"] = l.seconds;
  stage["warm"] = l.warm, stage["searched"] = l.searched;
  stage["memory_bytes"] = l.memory_bytes;
  stage["out_of_sample"] = py::none();
  if (const auto& f = l.out_of_sample) {
    stage["out_of_sample"] =
        py::make_tuple(f->scenarios, f->infeasible, f->mean, f->half_width, f->factorizations, f->seconds);
  }
  return stage;
}

py::dict dict_of(const ScenarioSolution& answer) {
  py::dict reported;
  reported["end"] = to_string(answer.end);
  reported["scenarios"] = answer.scenarios;
  reported["infeasible"] = answer.infeasible;
  py::list stages;
  for (const SampleAverageStage& stage : answer.stages) stages.append(dict_of(stage));
  reported["stages"] = stages;
  return reported;
}

py::dict solve(const py::object& lcqp, const py::dict& given, const py::dict& request,
               const py::object& report_stage, const Call& call) {
  const Options options = options_of(given);
  Borrowed arrays;
  ScenarioProblem problem;
  problem.base = arrays.problem(lcqp);
  const auto numbers = [&](const char* name) {
    const auto view = arrays.indices(request[name]);
    return std::vector<Index>(view.begin(), view.end());
  };
  problem.first_stage = numbers("first_stage");
  problem.own_equalities = numbers("own_equalities");
  problem.own_inequalities = numbers("own_inequalities");
  problem.own_pairs = numbers("own_pairs");
  const auto set = request.contains("table") ? set_scenarios(problem, table_of(arrays, request["table"]))
                                             : set_scenarios(problem, sampler_of(arrays, request["sampler"]));
  if (!set) raise(named(set.error()));
  ScenarioSettings settings = settings_of(request["settings"]);
  ScenarioSolution answer;
  py::dict reported = run(
      options, call,
      [&](const Options& limited, const SolveControls& controls, Reporter& reporter) -> Expected<Solution> {
        settings.options = limited;
        if (!report_stage.is_none()) {
          settings.stage = [&](const SampleAverageStage& stage) {
            reporter.call([&] { report_stage(dict_of(stage)); });
          };
        }
        auto solved = solve_scenarios(problem, settings, controls);
        if (!solved) return unexpected(named(solved.error()));
        Solution solution = std::exchange(solved->solution, {});
        answer = *std::move(solved);
        return solution;
      });
  reported["scenarios"] = dict_of(answer);
  return reported;
}

}  // namespace

void bind_scenarios(py::module_& m) { m.def("solve_scenarios", &solve); }

}  // namespace marble::python
