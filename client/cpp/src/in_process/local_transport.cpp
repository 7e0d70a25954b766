#include "in_process/in_process.h"
#include "transport.h"

namespace marble::client {
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
