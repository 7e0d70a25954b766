#include "message/status.h"
#include "remote/calls.h"
#include "transport.h"

namespace marble::client {
namespace {

class RemoteTransport final : public Transport {
 public:
  explicit RemoteTransport(std::shared_ptr<const Connection> connection)
      : connection_(std::move(connection)) {}

  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options,
                                               const SolveControls& controls,
                                               const CallControls& call) const override {
    return solve_remotely(*connection_, problem, options, controls, call);
  }

  [[nodiscard]] Expected<PendingSolution> solve_async(const ProblemView& problem, const Options& options,
                                                      const SolveControls& controls,
                                                      const CallControls& call) const override {
    return begin_solve(connection_, problem, options, controls, call);
  }

  [[nodiscard]] Expected<void> solve_batch(const BatchSource& source, const BatchSink& sink,
                                           const BatchControls& controls) const override {
    return solve_batch_remotely(*connection_, source, sink, controls);
  }

  [[nodiscard]] Expected<RemoteScenarios> solve_scenarios(const ScenarioProblem& problem,
                                                          const ScenarioSampler* sampler,
                                                          const ScenarioSettings& settings,
                                                          const SolveControls& controls,
                                                          const CallControls& call) const override {
    return solve_scenarios_remotely(*connection_, problem, sampler, settings, controls, call);
  }

  [[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled(const CoupledView& view,
                                                              const CoupledOptions& options,
                                                              const CoupledControls& controls,
                                                              const CallControls& call) const override {
    return solve_coupled_remotely(*connection_, view, options, controls, call);
  }

  [[nodiscard]] Expected<RemoteSegmentsSolution> solve_in_segments(const Problem& problem,
                                                                   std::span<const Index> stage_of_variable,
                                                                   const SegmentsOptions& options,
                                                                   const CoupledControls& controls,
                                                                   const CallControls& call) const override {
    return solve_in_segments_remotely(*connection_, problem, stage_of_variable, options, controls, call);
  }

  [[nodiscard]] Expected<std::unique_ptr<Session::State>> open_session(
      const ProblemView& problem, const Options& options, const SessionOptions& session) const override {
    return open_remote_session(connection_, problem, options, session);
  }

  [[nodiscard]] Expected<bool> healthy(const std::stop_token& stop) const override {
    grpc::ClientContext context;
    connection_->prepare(context, kQuickCall);
    const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
    grpc::health::v1::HealthCheckResponse response;
    const grpc::Status status = connection_->health().Check(&context, {}, &response);
    if (!status.ok()) return unexpected(to_error(status, stop));
    return response.status() == grpc::health::v1::HealthCheckResponse::SERVING;
  }

  [[nodiscard]] Expected<ServerInfo> info(const std::stop_token& stop) const override {
    return server_info(*connection_, stop);
  }

  [[nodiscard]] const std::string& address() const override { return connection_->address(); }
  [[nodiscard]] std::shared_ptr<const Connection> connection() const override { return connection_; }

 private:
  std::shared_ptr<const Connection> connection_;
};

}  // namespace

std::shared_ptr<const Transport> remote_transport(std::shared_ptr<const Connection> connection) {
  return std::make_shared<const RemoteTransport>(std::move(connection));
}

}  // namespace marble::client
