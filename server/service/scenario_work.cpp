#include "service/scenario_work.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "marble/contract.h"
#include "marble/convert.h"
#include "marble/convert_scenarios.h"

namespace marble::server {
namespace {

constexpr const char* kField = "scenarios";

// Renames fields to those of the message: "settings.growth" is "scenarios.growth".
Error named(Error error) {
  constexpr std::string_view kSettings = "settings.";
  if (error.field.starts_with(kSettings)) error.field.erase(0, kSettings.size());
  return inside(kField, std::move(error));
}

// Number of stages up to `most` scenarios, or one more than a job may have.
int stages_of(const ScenarioSettings& settings, std::int64_t most) {
  int stages = 1;
  double size = static_cast<double>(settings.initial_sample_size);
  while (size < static_cast<double>(most) && stages <= contract::most_stages) {
    size = std::max(size * settings.growth, std::ceil(size) + 1.0);
    ++stages;
  }
  return stages;
}

Expected<void> check_size(const Config& config, const ScenarioProblem& problem,
                          const ScenarioSettings& settings) {
  if (settings.max_sample_size > config.scenarios ||
      settings.out_of_sample_scenarios > config.scenarios - settings.max_sample_size)
    return unexpected(failure(ErrorCode::resource_exhausted, "max_sample_size",
                              std::to_string(settings.max_sample_size) + " and " +
                                  std::to_string(settings.out_of_sample_scenarios) + " out-of-sample ones",
                              "must be at most " + std::to_string(config.scenarios) +
                                  " together (the server's limit \"scenarios\")"));
  const std::int64_t most = std::min(settings.max_sample_size, problem.scenarios);
  if (stages_of(settings, most) > contract::most_stages)
    return unexpected(invalid(
        "growth", std::to_string(settings.growth),
        "must be so large that there are at most " + std::to_string(contract::most_stages) + " stages"));
  return check_initial_sample(problem, settings, config.solve_bytes);
}

}  // namespace

Expected<void> set_scenario_work(const Config& config, std::shared_ptr<const v1::SolveRequest> request,
                                 const Options& options, Job& job) {
  const v1::Scenarios& message = request->scenarios();
  const std::string alone = "must be absent: scenarios have their own starts";
  if (request->initial_point().z_size() > 0) return unexpected(invalid("initial_point.z", alone));
  if (request->has_warm_start()) return unexpected(invalid("warm_start", alone));
  if (request->has_sensitivity())
    return unexpected(invalid("sensitivity", "must be absent: a plan for many scenarios has none"));
  ScenarioProblem problem;
  problem.base = view_of(request->problem());
  if (auto taken = take_scenarios(message, problem); !taken) return unexpected(named(taken.error()));
  ScenarioSettings settings{.options = options};
  take_settings(message, settings);
  if (auto valid = check_scenarios(problem, settings); !valid) return unexpected(named(valid.error()));
  if (auto fits = check_size(config, problem, settings); !fits) return unexpected(named(fits.error()));
  settings.stage = [record = job.record](const SampleAverageStage& stage) { record->add_stage(stage); };
  const auto answer = std::make_shared<ScenarioSolution>();
  job.also = [answer](v1::Solution* solution) { to_message(*answer, solution->mutable_scenarios()); };
  // The problem borrows the message's arrays.
  job.work =
      [request = std::move(request), problem = std::move(problem), settings = std::move(settings),
       limits = SetupControls{.most_bytes = config.solve_bytes, .most_factorization_s = config.solve_seconds},
       answer](const SolveControls& controls) -> Expected<Solution> {
    auto solved = solve_scenarios(problem, settings, controls, limits);
    if (!solved) return unexpected(named(solved.error()));
    Solution solution = std::exchange(solved->solution, {});
    *answer = *std::move(solved);
    return solution;
  };
  return {};
}

}  // namespace marble::server
