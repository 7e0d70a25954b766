#include "remote/coupled.h"

#include <utility>

#include "connection/traceparent.h"
#include "marble/convert.h"
#include "marble/convert_coupled.h"
#include "message/request.h"
#include "message/solve_events.h"

namespace marble::client {
namespace {

class ToldIterations final : public ProgressSink {
 public:
  explicit ToldIterations(const CoupledControls& controls) : controls_(controls) {}
  void report(const Progress& row) override {
    if (controls_.progress) controls_.progress(coupled_iteration_of(row));
  }

 private:
  const CoupledControls& controls_;
};

Expected<v1::SolveStreamRequest> request_of(const ProblemView& problem, const CoupledOptions& options,
                                            const CallControls& call) {
  v1::SolveStreamRequest request;
  const RequestParts parts{problem,         options.options,   {},           nullptr, nullptr,
                           call.request_id, call.problem_name, call.priority};
  if (auto filled = fill_request(parts, request.mutable_solve()); !filled) return unexpected(filled.error());
  to_message(options, request.mutable_solve()->mutable_coupled());
  request.set_progress_interval_s(call.progress_interval_s);
  return request;
}

// Sends it, and fills what every answer has.
template <class Answer>
Expected<v1::Solution> solve_there(const Connection& connection, const v1::SolveStreamRequest& request,
                                   const CoupledControls& controls, const CallControls& call,
                                   Answer& answer) {
  if (auto fits = check_size(request); !fits) return unexpected(fits.error());
  grpc::ClientContext context;
  if (auto ready = connection.prepare(context, call.traceparent, connection.deadline_of(call.deadline));
      !ready)
    return unexpected(ready.error());
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const auto reader = connection.solver().SolveCoupled(&context, request);
  ToldIterations told(controls);
  v1::SolveResponse result;
  const auto last =
      read_events(*reader, &told, call, controls.stop, [&](const v1::SolveStreamResponse& event) {
        if (event.has_result()) result = event.result();
      });
  if (!last) return unexpected(of_field(coupled_core_field(last.error().field), last.error()));
  answer.job_id = last->job_id;
  answer.queue_s = last->queue_s;
  answer.total_s = last->total_s;
  answer.progress_skipped = last->progress_skipped;
  answer.traceparent = returned_traceparent(context);
  const v1::CoupledOutcome& outcome = result.solution().coupled();
  answer.coordination = coordination_of(outcome);
  answer.blocks_objective = outcome.blocks_objective();
  return std::move(*result.mutable_solution());
}

}  // namespace

Expected<RemoteCoupledSolution> solve_coupled_there(const Connection& connection, const CoupledView& view,
                                                    const CoupledOptions& options,
                                                    const CoupledControls& controls,
                                                    const CallControls& call) {
  if (controls.start != nullptr && !controls.start->blocks.empty())
    return unexpected(invalid("start.blocks", "must be empty: a server takes prices alone"));
  auto request = request_of({}, options, call);
  if (!request) return unexpected(request.error());
  v1::SolveRequest& solve = *request->mutable_solve();
  const std::string name = solve.problem().name();
  solve.clear_problem();
  solve.mutable_problem()->set_name(name);
  to_message(view, solve.mutable_coupled());
  if (controls.start != nullptr)
    solve.mutable_coupled()->mutable_prices()->Assign(controls.start->prices.begin(),
                                                      controls.start->prices.end());
  RemoteCoupledSolution answer;
  const auto solution = solve_there(connection, *request, controls, call, answer);
  if (!solution) return unexpected(solution.error());
  answer.joint = solution_of(*solution);
  answer.places = joint_places(view);
  return answer;
}

Expected<RemotePiecesSolution> solve_in_pieces_there(const Connection& connection, const Problem& problem,
                                                     std::span<const Index> stage_of_variable,
                                                     const PiecesOptions& options,
                                                     const CoupledControls& controls,
                                                     const CallControls& call) {
  auto request = request_of(problem.view(), options.coupled, call);
  if (!request) return unexpected(request.error());
  v1::Pieces* pieces = request->mutable_solve()->mutable_coupled()->mutable_pieces();
  pieces->mutable_stages()->Assign(stage_of_variable.begin(), stage_of_variable.end());
  pieces->set_pieces(options.pieces);
  pieces->set_look_ahead(options.look_ahead);
  RemotePiecesSolution answer;
  const auto solution = solve_there(connection, *request, controls, call, answer);
  if (!solution) return unexpected(solution.error());
  answer.whole = solution_of(*solution);
  answer.sweep_objective = solution->coupled().sweep_objective();
  answer.sweep_factorizations = solution->coupled().sweep_factorizations();
  return answer;
}

}  // namespace marble::client
