#include "remote/composite_request.h"

#include <algorithm>
#include <limits>
#include <string>

#include "marble/convert.h"
#include "marble/convert_coupled.h"
#include "marble/convert_scenarios.h"
#include "message/request.h"

namespace marble::client {
namespace {

Expected<v1::SolveStreamRequest> request_of(const ProblemView& problem, const CoupledOptions& options,
                                            const CallControls& call) {
  v1::SolveStreamRequest request;
  const RequestParts parts{problem,         options.options,   {},           nullptr, nullptr,
                           call.request_id, call.problem_name, call.priority};
  MARBLE_RETURN_IF_ERROR(fill_request(parts, request.mutable_solve()));
  to_message(options, request.mutable_solve()->mutable_coupled());
  request.set_progress_interval_s(call.progress_interval_s);
  return request;
}

// Fills the fields common to all results.
template <class Answer>
Expected<Answer> answer_of(const v1::SolveResponse& response) {
  const v1::Solution& solution = response.solution();
  if (!solution.has_coupled()) {
    return unexpected(failure(ErrorCode::failed_precondition, "coupled",
                              "is not in this answer: its problem was solved alone"));
  }
  Answer answer;
  answer.job_id = response.job_id();
  answer.queue_s = solution.times().queue_s();
  answer.total_s = solution.times().total_s();
  answer.coordination = coordination_of(solution.coupled());
  answer.blocks_objective = solution.coupled().blocks_objective();
  return answer;
}

}  // namespace

Expected<v1::SolveStreamRequest> make_request(const CoupledView& view, const CoupledOptions& options,
                                              const CoupledControls& controls, const CallControls& call) {
  if (controls.start != nullptr && !controls.start->blocks.empty())
    return unexpected(invalid("start.blocks", "must be empty: a server takes coupling_multipliers alone"));
  MARBLE_ASSIGN_OR_RETURN(auto request, request_of({}, options, call));
  v1::SolveRequest& solve = *request.mutable_solve();
  const std::string name = solve.problem().name();
  solve.clear_problem();
  solve.mutable_problem()->set_name(name);
  to_message(view, solve.mutable_coupled());
  if (controls.start != nullptr)
    solve.mutable_coupled()->mutable_coupling_multipliers()->Assign(
        controls.start->coupling_multipliers.begin(), controls.start->coupling_multipliers.end());
  MARBLE_RETURN_IF_ERROR(check_size(request));
  return request;
}

Expected<v1::SolveStreamRequest> make_request(const Problem& problem,
                                              std::span<const Index> stage_of_variable,
                                              const SegmentsOptions& options, const CallControls& call) {
  MARBLE_ASSIGN_OR_RETURN(auto request, request_of(problem.view(), options.coupled, call));
  v1::Segments* segments = request.mutable_solve()->mutable_coupled()->mutable_segments();
  segments->mutable_stages()->Assign(stage_of_variable.begin(), stage_of_variable.end());
  segments->set_num_segments(options.num_segments);
  segments->set_overlap(options.overlap);
  MARBLE_RETURN_IF_ERROR(check_size(request));
  return request;
}

Expected<RemoteCoupledSolution> remote_coupled(const v1::SolveResponse& response, const CoupledView& view) {
  MARBLE_ASSIGN_OR_RETURN(auto answer, answer_of<RemoteCoupledSolution>(response));
  answer.monolithic = solution_of(response.solution());
  answer.places = monolithic_places(view);
  const BlockPlace& ends = answer.places.back();
  const std::size_t equalities = static_cast<std::size_t>(ends.equalities) + view.coupling_rhs.size();
  if (answer.monolithic.z.size() != static_cast<std::size_t>(ends.variables) ||
      answer.monolithic.equality_multipliers.size() != equalities) {
    return unexpected(invalid(
        "blocks", std::to_string(ends.variables) + " variables",
        "must be those that were sent: the answer has " + std::to_string(answer.monolithic.z.size())));
  }
  return answer;
}

Expected<RemoteSegmentsSolution> remote_segments(const v1::SolveResponse& response) {
  MARBLE_ASSIGN_OR_RETURN(auto answer, answer_of<RemoteSegmentsSolution>(response));
  answer.whole = solution_of(response.solution());
  answer.sweep_objective = response.solution().coupled().sweep_objective();
  answer.sweep_factorizations = response.solution().coupled().sweep_factorizations();
  return answer;
}

Expected<v1::SolveStreamRequest> make_request(const ScenarioProblem& problem, const ScenarioSampler* sampler,
                                              const ScenarioSettings& settings, const CallControls& call) {
  v1::SolveStreamRequest request;
  const RequestParts parts{problem.base,    settings.options,  {},           nullptr, nullptr,
                           call.request_id, call.problem_name, call.priority};
  MARBLE_RETURN_IF_ERROR(fill_request(parts, request.mutable_solve()));
  v1::Scenarios* scenarios = request.mutable_solve()->mutable_scenarios();
  to_message(settings, scenarios);
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  const std::int64_t out_of_sample = std::max<std::int64_t>(settings.out_of_sample_scenarios, 0);
  const std::int64_t count =
      settings.max_sample_size > kMost - out_of_sample ? kMost : settings.max_sample_size + out_of_sample;
  MARBLE_RETURN_IF_ERROR(to_message(problem, sampler != nullptr ? 0 : count, scenarios));
  if (sampler != nullptr) to_message(*sampler, scenarios->mutable_sampler());
  request.set_progress_interval_s(call.progress_interval_s);
  MARBLE_RETURN_IF_ERROR(check_size(request));
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
