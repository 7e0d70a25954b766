// Provides Client: a connection to a Marble server, or the solver in this process behind the same calls.
//
//   auto client = marble::Client::connect("robot:50051");   // remote
//   auto client = marble::Client::in_process();              // local; the rest is the same
//   auto answer = client->solve(problem, options);
//   auto session = client->open_session(problem, options);
#pragma once

#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/batch.h"
#include "marble/call_controls.h"
#include "marble/connect_options.h"
#include "marble/coupled.h"
#include "marble/error.h"
#include "marble/jobs.h"
#include "marble/options.h"
#include "marble/pending_solution.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/remote_scenarios.h"
#include "marble/server_info.h"
#include "marble/session.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

namespace client {
class Transport;
}

/// Is thread-safe; one connection serves any number of concurrent calls. No call throws.
/// Errors: unavailable (not reachable, draining, not a Marble server), invalid_argument (field, index and
/// bound as Problem::create reports them), resource_exhausted, deadline_exceeded, cancelled, unauthenticated,
/// permission_denied, internal.
class Client {
 public:
  /// Connects to `address`: host:port, unix:PATH, a comma-separated list of host:port, dns:///host:port for
  /// every address of the name, or "local", which is in_process(). With several addresses, calls rotate over
  /// the servers that report to be healthy. Without a named server the address is 127.0.0.1:50051: nothing
  /// else is solved in process. If no server listens there, calls end with `unavailable` and an explanation.
  /// Only checks the address and the options: the first call makes the connection, and a later call makes it
  /// again if it broke. Calls that get `unavailable` before any response are retried up to three times,
  /// except for sessions and batches. The error's field is "address" or that of the option.
  [[nodiscard]] static Expected<Client> connect(
      const std::string& address = default_server_address(),
      const ConnectOptions& options = ConnectOptions::from_environment());

  /// Solves in the callers' own threads with the same solver: the same bits, without a server or a network.
  /// jobs() and info(), which need a server, return the error unavailable. Priorities, names and ids have no
  /// effect; `accepted` and `moved` are not called; a batch is solved one problem after the other.
  [[nodiscard]] static Client in_process();

  /// A moved-from object may only be assigned to or destroyed.
  Client(Client&&) noexcept;
  /// As the constructor.
  Client& operator=(Client&&) noexcept;
  ~Client();

  /// Solves on the server. `controls` work as in a Solver: progress is reported on the calling thread, and
  /// the stop token cancels the call with the error cancelled, also in process; the solve ends within one
  /// iteration. (marble::solve_in_process of marble::core returns its best iterate instead.) Opens a stream
  /// if a callback or sink is set, else makes one unary call.
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options = {},
                                               const SolveControls& controls = {},
                                               const CallControls& call = {}) const;

  /// Solves without waiting: returns once the problem is copied. `controls.progress` and the functions of
  /// `call` are called on other threads, one at a time, until the handle ends; they must not block or throw.
  /// Of the controls only progress, stop, initial_z, warm_start and sensitivity are used.
  [[nodiscard]] Expected<PendingSolution> solve_async(const ProblemView& problem, const Options& options = {},
                                                      const SolveControls& controls = {},
                                                      const CallControls& call = {}) const;

  /// Computes one plan for many scenarios on a server, as marble::solve_scenarios does, from the first
  /// max_sample_size + out_of_sample_scenarios scenarios, whose numbers are sent. Each sample-average stage
  /// is reported on the calling thread, without its x. Of the controls only progress and stop are used; stop
  /// cancels the call with the error cancelled. (Option time_limit_s ends with the newest plan.) In process
  /// the deadline is ignored.
  [[nodiscard]] Expected<RemoteScenarios> solve_scenarios(const ScenarioProblem& problem,
                                                          const ScenarioSettings& settings = {},
                                                          const SolveControls& controls = {},
                                                          const CallControls& call = {}) const;
  /// The same for scenarios that the server draws; the problem needs no `sample`.
  [[nodiscard]] Expected<RemoteScenarios> solve_scenarios(ScenarioProblem problem,
                                                          const ScenarioSampler& sampler,
                                                          const ScenarioSettings& settings = {},
                                                          const SolveControls& controls = {},
                                                          const CallControls& call = {}) const;

  /// Solves many problems on one stream. Every problem that the source returned gets exactly one result: the
  /// stream's own error if the stream broke. That error is returned too. Flow control slows down a source
  /// that is faster than the server.
  [[nodiscard]] Expected<void> solve_batch(const BatchSource& source, const BatchSink& sink,
                                           const BatchControls& controls = {}) const;
  /// The same for problems that are all in memory.
  [[nodiscard]] Expected<void> solve_batch(std::span<const BatchProblem> problems, const BatchSink& sink,
                                           const BatchControls& controls = {}) const;

  /// Opens a session and waits until it is ready. It may outlive the client.
  [[nodiscard]] Expected<Session> open_session(const ProblemView& problem, const Options& options = {},
                                               const SessionOptions& session = {}) const;

  /// Solves a coupled problem on one server, its blocks on idle workers, as marble::solve_coupled does, with
  /// the same bits. Of the controls are used: progress, called on the calling thread and without `frozen`;
  /// stop, which cancels the call with the error cancelled; and the coupling_multipliers of start. (Option
  /// time_limit_s ends with the current state of the blocks.) In process the deadline is ignored. Errors: as
  /// those of marble::solve_coupled.
  [[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled(const CoupledView& view,
                                                              const CoupledOptions& options = {},
                                                              const CoupledControls& controls = {},
                                                              const CallControls& call = {}) const;
  /// The same for a long horizon: marble::solve_in_segments.
  [[nodiscard]] Expected<RemoteSegmentsSolution> solve_in_segments(const Problem& problem,
                                                                   std::span<const Index> stage_of_variable,
                                                                   const SegmentsOptions& options = {},
                                                                   const CoupledControls& controls = {},
                                                                   const CallControls& call = {}) const;

  /// Solves a coupled problem with a session for each block, distributed over the servers of the address.
  /// This process coordinates, and solves the monolithic problem at the end. A server sees only its own
  /// blocks with their E_k, and the coupling_multipliers of those rows. A step whose server or session is
  /// lost is repeated elsewhere; where a server has no capacity for a session, each step is a separate solve.
  /// `controls` are as in marble::solve_coupled; without a runner up to 64 threads wait for the servers. In
  /// process this is marble::solve_coupled. Errors: those of marble::solve_coupled, the servers' errors about
  /// a block that none of them accepts, and cancelled.
  [[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled_by_sessions(
      const CoupledView& view, const CoupledOptions& options = {}, const CoupledControls& controls = {},
      const BlockSessions& sessions = {}) const;
  /// The same for a long horizon: marble::solve_in_segments, whose segments are coordinated in sessions.
  /// Their forward pass, one segment after the other, runs in this process.
  [[nodiscard]] Expected<RemoteSegmentsSolution> solve_in_segments_by_sessions(
      const Problem& problem, std::span<const Index> stage_of_variable, const SegmentsOptions& options = {},
      const CoupledControls& controls = {}, const BlockSessions& sessions = {}) const;

  /// Returns access to jobs by their ids.
  [[nodiscard]] Jobs jobs() const;

  /// Returns true if the server accepts jobs, false if it drains. `stop` cancels the request with the error
  /// cancelled.
  [[nodiscard]] Expected<bool> healthy(const std::stop_token& stop = {}) const;

  /// Returns the server's information about itself; with several servers, that of one of them. `stop` as
  /// above.
  [[nodiscard]] Expected<ServerInfo> info(const std::stop_token& stop = {}) const;

  /// Returns the address as it was given; "in process" without one.
  [[nodiscard]] const std::string& address() const;

 private:
  explicit Client(std::shared_ptr<const client::Transport> transport);
  [[nodiscard]] Expected<std::vector<Client>> each() const;
  std::shared_ptr<const client::Transport> transport_;
};

/// Solves on the server that MARBLE_SERVER names, or in this process if it names none or is "local": the
/// environment decides, not the program. An unreachable server is an error and never causes a local solve.
/// The connection is kept for later calls as long as MARBLE_SERVER and the environment variables that
/// ConnectOptions reads do not change. The rest is as in Client::solve. Thread-safe.
[[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options = {},
                                             const SolveControls& controls = {},
                                             const CallControls& call = {});

}  // namespace marble
