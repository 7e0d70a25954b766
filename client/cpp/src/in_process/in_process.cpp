#include "in_process/in_process.h"

#include <algorithm>
#include <limits>
#include <new>

#include "message/status.h"
#include "transport.h"

namespace marble::client {

using Clock = std::chrono::steady_clock;

DeadlineLimit::DeadlineLimit(std::optional<std::chrono::duration<double>> from_now)
    : begin_(Clock::now()),
      seconds_(from_now ? std::max(from_now->count(), 0.0) : std::numeric_limits<double>::infinity()) {}

double DeadlineLimit::left_s() const {
  return seconds_ - std::chrono::duration<double>(Clock::now() - begin_).count();
}

Options DeadlineLimit::limit(Options options) const {
  options.time_limit_s = std::clamp(left_s(), 0.0, options.time_limit_s);
  return options;
}

Expected<RemoteSolution> DeadlineLimit::answer(Expected<Solution> solution) const {
  if (!solution) return unexpected(std::move(solution.error()));
  if (solution->status == Status::cancelled) return unexpected(given_up());
  if (!(left_s() > 0.0)) {
    return unexpected(
        failure(ErrorCode::deadline_exceeded, "the deadline passed while the problem was solved"));
  }
  return answer_of_session(std::move(solution));
}

Expected<RemoteSolution> DeadlineLimit::answer_of_session(Expected<Solution> solution) const {
  if (!solution) return unexpected(std::move(solution.error()));
  if (solution->status == Status::cancelled) return unexpected(given_up());
  RemoteSolution answer;
  static_cast<Solution&>(answer) = std::move(*solution);
  answer.total_s = std::chrono::duration<double>(Clock::now() - begin_).count();
  return answer;
}

void ThinnedProgress::report(const Progress& progress) {
  if (last_s_ >= 0.0 && progress.elapsed_s - last_s_ < interval_s_) return;
  last_s_ = progress.elapsed_s;
  Progress reported = without_vectors(progress);
  if (iterate_every_ > 0 && progress.iteration % iterate_every_ == 0) reported.z = progress.z;
  sink_->report(reported);
}

Expected<RemoteSolution> solve_locally(const ProblemView& problem, const Options& options,
                                       const SolveControls& controls, const CallControls& call) {
  MARBLE_RETURN_IF_ERROR(validate(options));
  const DeadlineLimit deadline(call.deadline);
  ThinnedProgress progress(controls.progress, call.progress_interval_s, call.iterate_every);
  if (call.started) call.started(0.0);
  SolveControls own = controls;
  own.progress = progress.sink();
  return deadline.answer(solve_in_process(problem, deadline.limit(options), own));
}

Expected<void> solve_batch_locally(const BatchSource& source, const BatchSink& sink,
                                   const BatchControls& controls) {
  while (!controls.stop.stop_requested()) {
    const std::optional<BatchProblem> p = source();
    if (!p) return {};
    CallControls call;
    call.problem_name = p->problem_name;
    sink(p->tag,
         solve_locally(p->problem, p->options,
                       {.stop = controls.stop, .initial_z = p->initial_z, .sensitivity = p->sensitivity},
                       call));
  }
  return unexpected(given_up());
}

namespace {

// A solve that was stopped is an error, as for a client of a server.
template <class Result, class Solved>
Expected<Result> unless_given_up(Expected<Solved> solved, bool (*is_given_up)(const Solved&)) {
  if (!solved) return unexpected(std::move(solved.error()));
  if (is_given_up(*solved)) return unexpected(given_up());
  Result result;
  static_cast<Solved&>(result) = *std::move(solved);
  return result;
}

class LocalTransport final : public Transport {
 public:
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options,
                                               const SolveControls& controls,
                                               const CallControls& call) const override {
    return solve_locally(problem, options, controls, call);
  }

  [[nodiscard]] Expected<PendingSolution> solve_async(const ProblemView& problem, const Options& options,
                                                      const SolveControls& controls,
                                                      const CallControls& call) const override {
    return begin_solve_locally(problem, options, controls, call);
  }

  [[nodiscard]] Expected<void> solve_batch(const BatchSource& source, const BatchSink& sink,
                                           const BatchControls& controls) const override {
    return solve_batch_locally(source, sink, controls);
  }

  [[nodiscard]] Expected<RemoteScenarios> solve_scenarios(const ScenarioProblem& problem,
                                                          const ScenarioSampler* /*sampler*/,
                                                          const ScenarioSettings& settings,
                                                          const SolveControls& controls,
                                                          const CallControls& /*call*/) const override {
    return unless_given_up<RemoteScenarios, ScenarioSolution>(
        marble::solve_scenarios(problem, settings, controls),
        [](const ScenarioSolution& solved) { return solved.end == ScenarioEnd::cancelled; });
  }

  [[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled(const CoupledView& view,
                                                              const CoupledOptions& options,
                                                              const CoupledControls& controls,
                                                              const CallControls& /*call*/) const override {
    return unless_given_up<RemoteCoupledSolution, CoupledSolution>(
        marble::solve_coupled(view, options, controls),
        [](const CoupledSolution& solved) { return solved.monolithic.status == Status::cancelled; });
  }

  [[nodiscard]] Expected<RemoteSegmentsSolution> solve_in_segments(
      const Problem& problem, std::span<const Index> stage_of_variable, const SegmentsOptions& options,
      const CoupledControls& controls, const CallControls& /*call*/) const override {
    return unless_given_up<RemoteSegmentsSolution, SegmentsSolution>(
        marble::solve_in_segments(problem, stage_of_variable, options, controls),
        [](const SegmentsSolution& solved) { return solved.whole.status == Status::cancelled; });
  }

  [[nodiscard]] Expected<std::unique_ptr<Session::State>> open_session(
      const ProblemView& problem, const Options& options, const SessionOptions& session) const override {
    return open_session_in_process(problem, options, session);
  }

  [[nodiscard]] Expected<bool> healthy(const std::stop_token& /*stop*/) const override { return true; }
  [[nodiscard]] Expected<ServerInfo> info(const std::stop_token& /*stop*/) const override {
    return unexpected(no_server());
  }

  [[nodiscard]] const std::string& address() const override {
    static const std::string in_process = kInProcess;
    return in_process;
  }
  [[nodiscard]] std::shared_ptr<const Connection> connection() const override { return nullptr; }
};

}  // namespace

std::shared_ptr<const Transport> local_transport() {
  static const auto transport = std::make_shared<const LocalTransport>();
  return transport;
}

}  // namespace marble::client
