// The interface behind a Client: this process, or a connection to servers. Nothing else knows which.
#pragma once

#include <memory>
#include <span>
#include <stop_token>
#include <string>

#include "connection/connection.h"
#include "marble/batch.h"
#include "marble/coupled.h"
#include "marble/remote_scenarios.h"
#include "marble/server_info.h"
#include "pending_solve.h"
#include "session_state.h"

namespace marble::client {

/// The functions of Client with these names, but they may throw bad_alloc. Thread-safe.
class Transport {
 public:
  virtual ~Transport() = default;
  [[nodiscard]] virtual Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options,
                                                       const SolveControls& controls,
                                                       const CallControls& call) const = 0;
  [[nodiscard]] virtual Expected<PendingSolution> solve_async(const ProblemView& problem,
                                                              const Options& options,
                                                              const SolveControls& controls,
                                                              const CallControls& call) const = 0;
  [[nodiscard]] virtual Expected<void> solve_batch(const BatchSource& source, const BatchSink& sink,
                                                   const BatchControls& controls) const = 0;
  /// If the sampler is null, the scenarios are those of the problem.
  [[nodiscard]] virtual Expected<RemoteScenarios> solve_scenarios(const ScenarioProblem& problem,
                                                                  const ScenarioSampler* sampler,
                                                                  const ScenarioSettings& settings,
                                                                  const SolveControls& controls,
                                                                  const CallControls& call) const = 0;
  [[nodiscard]] virtual Expected<RemoteCoupledSolution> solve_coupled(const CoupledView& view,
                                                                      const CoupledOptions& options,
                                                                      const CoupledControls& controls,
                                                                      const CallControls& call) const = 0;
  [[nodiscard]] virtual Expected<RemoteSegmentsSolution> solve_in_segments(
      const Problem& problem, std::span<const Index> stage_of_variable, const SegmentsOptions& options,
      const CoupledControls& controls, const CallControls& call) const = 0;
  [[nodiscard]] virtual Expected<std::unique_ptr<Session::State>> open_session(
      const ProblemView& problem, const Options& options, const SessionOptions& session) const = 0;
  [[nodiscard]] virtual Expected<bool> healthy(const std::stop_token& stop) const = 0;
  [[nodiscard]] virtual Expected<ServerInfo> info(const std::stop_token& stop) const = 0;
  [[nodiscard]] virtual const std::string& address() const = 0;
  /// Returns the connection for calls that only servers have; null in process.
  [[nodiscard]] virtual std::shared_ptr<const Connection> connection() const = 0;
};

[[nodiscard]] std::shared_ptr<const Transport> local_transport();
[[nodiscard]] std::shared_ptr<const Transport> remote_transport(std::shared_ptr<const Connection> connection);

}  // namespace marble::client
