#include "replay/solve_request.h"

#include "marble/composite/coupled_progress.h"
#include "marble/convert.h"
#include "marble/convert_coupled.h"
#include "marble/convert_scenarios.h"

namespace marble::cli {
namespace {

class Rows final : public ProgressSink {
 public:
  explicit Rows(std::vector<Progress>& rows) : rows_(rows) {}
  void report(const Progress& row) override { rows_.push_back(without_vectors(row)); }

 private:
  std::vector<Progress>& rows_;
};

Expected<Solved> solve_plain(const Client& client, const v1::SolveRequest& request, const Options& options,
                             const std::stop_token& stop, const CallControls& call) {
  Solved solved;
  Rows rows(solved.rows);
  const auto& z = request.initial_point().z();
  SolveControls controls{&rows, stop, {z.data(), static_cast<std::size_t>(z.size())}};
  Solution warm_start;
  if (request.has_warm_start()) {
    warm_start = solution_of(request.warm_start());
    controls.warm_start = &warm_start;
  }
  SensitivityRequest sensitivity;
  if (request.has_sensitivity()) {
    sensitivity = request_of(request.sensitivity());
    controls.sensitivity = &sensitivity;
  }
  MARBLE_ASSIGN_OR_RETURN(const auto answer,
                          client.solve(view_of(request.problem()), options, controls, call));
  to_message(answer, &solved.solution);
  solved.all_rows = answer.progress_skipped == 0;
  return solved;
}

Expected<Solved> solve_scenarios(const Client& client, const v1::SolveRequest& request,
                                 const Options& options, const std::stop_token& stop,
                                 const CallControls& call) {
  Solved solved;
  Rows rows(solved.rows);
  ScenarioProblem problem;
  problem.base = view_of(request.problem());
  MARBLE_RETURN_IF_ERROR(take_scenarios(request.scenarios(), problem));
  ScenarioSettings settings{.options = options};
  take_settings(request.scenarios(), settings);
  MARBLE_ASSIGN_OR_RETURN(const auto answer, client.solve_scenarios(problem, settings, {&rows, stop}, call));
  to_message(answer.solution, &solved.solution);
  to_message(answer, solved.solution.mutable_scenarios());
  solved.all_rows = answer.progress_skipped == 0;
  return solved;
}

Expected<Solved> solve_coupled(const Client& client, const v1::SolveRequest& request, const Options& options,
                               const std::stop_token& stop, const CallControls& call) {
  Solved solved;
  const v1::Coupled& coupled = request.coupled();
  CoupledControls controls{.stop = stop};
  controls.progress = [&](const CoupledIteration& iteration) {
    solved.rows.push_back(row_of(iteration, 0.0));
  };
  v1::CoupledOutcome* outcome = solved.solution.mutable_coupled();
  if (!coupled.has_segments()) {
    CoupledOptions settings;
    settings.options = options;
    take_settings(coupled, settings);
    const CoupledStart start{{coupled.coupling_multipliers().begin(), coupled.coupling_multipliers().end()},
                             {}};
    if (!start.coupling_multipliers.empty()) controls.start = &start;
    MARBLE_ASSIGN_OR_RETURN(const auto answer,
                            client.solve_coupled(coupled_of(coupled), settings, controls, call));
    to_message(answer.monolithic, &solved.solution);
    to_message(answer.coordination, answer.blocks_objective, outcome);
    solved.all_rows = answer.progress_skipped == 0;
    return solved;
  }
  const v1::Segments& segments = coupled.segments();
  SegmentsOptions settings{.num_segments = segments.num_segments()};
  settings.coupled.options = options;
  take_settings(coupled, settings.coupled);
  if (segments.has_overlap()) settings.overlap = segments.overlap();
  MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(view_of(request.problem())));
  const std::span stages(segments.stages().data(), static_cast<std::size_t>(segments.stages_size()));
  MARBLE_ASSIGN_OR_RETURN(const auto answer,
                          client.solve_in_segments(problem, stages, settings, controls, call));
  to_message(answer.whole, &solved.solution);
  to_message(answer.coordination, answer.blocks_objective, outcome);
  outcome->set_sweep_objective(answer.sweep_objective);
  outcome->set_sweep_factorizations(answer.sweep_factorizations);
  solved.all_rows = answer.progress_skipped == 0;
  return solved;
}

}  // namespace

Expected<Solved> solve_request(const Client& client, const v1::SolveRequest& request, const Options& options,
                               const std::stop_token& stop) {
  CallControls call;
  call.problem_name = request.problem().name();
  if (request.has_coupled()) return solve_coupled(client, request, options, stop, call);
  if (request.has_scenarios()) return solve_scenarios(client, request, options, stop, call);
  return solve_plain(client, request, options, stop, call);
}

}  // namespace marble::cli
