#include "remote/scenario_request.h"

#include <algorithm>
#include <limits>

#include "marble/convert_scenarios.h"
#include "message/request.h"

namespace marble::client {

Expected<v1::SolveStreamRequest> make_request(const ScenarioProblem& problem, const ScenarioSampler* sampler,
                                              const ScenarioSettings& settings, const CallControls& call) {
  v1::SolveStreamRequest request;
  const RequestParts parts{problem.base,    settings.options,  {},           nullptr, nullptr,
                           call.request_id, call.problem_name, call.priority};
  if (auto filled = fill_request(parts, request.mutable_solve()); !filled) return unexpected(filled.error());
  v1::Scenarios* scenarios = request.mutable_solve()->mutable_scenarios();
  to_message(settings, scenarios);
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  const std::int64_t out_of_sample = std::max<std::int64_t>(settings.out_of_sample_scenarios, 0);
  const std::int64_t count =
      settings.max_sample_size > kMost - out_of_sample ? kMost : settings.max_sample_size + out_of_sample;
  if (auto reported = to_message(problem, sampler != nullptr ? 0 : count, scenarios); !reported)
    return unexpected(reported.error());
  if (sampler != nullptr) to_message(*sampler, scenarios->mutable_sampler());
  request.set_progress_interval_s(call.progress_interval_s);
  if (auto fits = check_size(request); !fits) return unexpected(fits.error());
  return request;
}

Expected<RemoteScenarios> remote_scenarios(const v1::SolveResponse& response) {
  const v1::Solution& solution = response.solution();
  if (!solution.has_scenarios())
    return unexpected(failure(ErrorCode::failed_precondition, "scenarios",
                              "are none in this answer: its problem was solved alone"));
  RemoteScenarios answer;
  static_cast<ScenarioSolution&>(answer) = scenario_solution_of(solution);
  answer.job_id = response.job_id();
  answer.queue_s = solution.times().queue_s();
  answer.total_s = solution.times().total_s();
  return answer;
}

}  // namespace marble::client
