// A connection to a Marble server, or the solver of this process behind the same calls.
//
//   auto client = marble::Client::connect("robot:50051");   // there
//   auto client = marble::Client::in_process();              // here; all else stays
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

/// Thread-safe; one connection serves any number of calls at once. No call throws.
/// Errors: unavailable (not reachable, draining, not a Marble server), invalid_argument (field, index and
/// bound as Problem::create says them), resource_exhausted, deadline_exceeded, cancelled, unauthenticated,
/// permission_denied, internal.
class Client {
 public:
  /// `address` is host:port or unix:PATH; or several host:port with commas between, or dns:///host:port for
  /// every address that the name has: calls then go round those of them that say they are healthy; or
  /// "local", which is in_process(). A client solves nothing else in process: where no server is named the
  /// address is 127.0.0.1:50051, and where nobody listens there calls end with `unavailable` and say what to
  /// do. Only checks the address and the options: the connection is made by the first call, and made again by
  /// a later one if it broke. Calls that got `unavailable` before any answer are repeated up to three times,
  /// but for sessions and batches. The error's field is "address" or that of the option.
  [[nodiscard]] static Expected<Client> connect(
      const std::string& address = default_server_address(),
      const ConnectOptions& options = ConnectOptions::from_environment());

  /// Solves in the callers' own threads, by the same solver: the same bits, without a server or a network.
  /// What only a server has is the error unavailable: jobs() and info(). Its priorities, names and ids mean
  /// nothing here; `accepted` and `moved` are not called; batches are solved one after the other.
  [[nodiscard]] static Client in_process();

  /// What was moved from may only be assigned to or destroyed.
  Client(Client&&) noexcept;
  /// As the constructor.
  Client& operator=(Client&&) noexcept;
  ~Client();

  /// Solves on the server. `controls` mean what they mean to a Solver: progress is reported on the
  /// calling thread, the stop token gives the call up: the error cancelled, in process too, and the solve
  /// ends within one iteration. (marble::solve_in_process of marble::core answers with its best iterate
  /// instead.) Streams if anything wants to be told, else makes one unary call.
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options = {},
                                               const SolveControls& controls = {},
                                               const CallControls& call = {}) const;

  /// The same without waiting: returns once the problem is copied. `controls.progress` and the functions of
  /// `call` are called on other threads, one at a time, until the handle's end; they must not block or throw.
  /// Of the controls count progress, stop, initial_z, warm_start and sensitivity.
  [[nodiscard]] Expected<PendingSolution> solve_async(const ProblemView& problem, const Options& options = {},
                                                      const SolveControls& controls = {},
                                                      const CallControls& call = {}) const;

  /// One plan for many worlds, by a server: as marble::solve_scenarios, of the first most_scenarios +
  /// fresh_scenarios worlds, whose numbers are sent. Each level is told on the calling thread, without its x.
  /// Of the controls count progress and stop, which gives the call up: the error cancelled. (Option
  /// time_limit_s ends with the newest plan.) In process the deadline is not looked at.
  [[nodiscard]] Expected<RemoteScenarios> solve_scenarios(const ScenarioProblem& problem,
                                                          const ScenarioSettings& settings = {},
                                                          const SolveControls& controls = {},
                                                          const CallControls& call = {}) const;
  /// The same of worlds that the server draws; the problem needs no `sample`.
  [[nodiscard]] Expected<RemoteScenarios> solve_scenarios(ScenarioProblem problem,
                                                          const ScenarioSampler& sampler,
                                                          const ScenarioSettings& settings = {},
                                                          const SolveControls& controls = {},
                                                          const CallControls& call = {}) const;

  /// Solves many problems on one stream. Every problem that the source gave is answered exactly once, with
  /// the stream's own error if it broke; that error is returned too. A source faster than the server is
  /// slowed down.
  [[nodiscard]] Expected<void> solve_batch(const BatchSource& source, const BatchSink& sink,
                                           const BatchControls& controls = {}) const;
  /// The same of problems that are all there.
  [[nodiscard]] Expected<void> solve_batch(std::span<const BatchProblem> problems, const BatchSink& sink,
                                           const BatchControls& controls = {}) const;

  /// Sets a session up and waits until it is ready. It may outlive the client.
  [[nodiscard]] Expected<Session> open_session(const ProblemView& problem, const Options& options = {},
                                               const SessionOptions& session = {}) const;

  /// Solves a coupled problem on one server, its blocks on idle workers: marble::solve_coupled, with the same
  /// bits. Of the controls count progress, called on the calling thread and without `frozen`, stop, which
  /// gives the call up: the error cancelled, and the prices of start. (Option time_limit_s ends with where
  /// the blocks are.) In process the deadline is not looked at. Errors: as marble::solve_coupled names them.
  [[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled(const CoupledView& view,
                                                              const CoupledOptions& options = {},
                                                              const CoupledControls& controls = {},
                                                              const CallControls& call = {}) const;
  /// The same of a long horizon: marble::solve_in_pieces.
  [[nodiscard]] Expected<RemotePiecesSolution> solve_in_pieces(const Problem& problem,
                                                               std::span<const Index> stage_of_variable,
                                                               const PiecesOptions& options = {},
                                                               const CoupledControls& controls = {},
                                                               const CallControls& call = {}) const;

  /// Solves a coupled problem with a session for each block, dealt to the servers that the address lists;
  /// this process coordinates, and solves the joint problem at the end. A server sees its own blocks with
  /// their E_k, and the prices of those rows, of no other block anything. A step whose server or session is
  /// lost is asked for again elsewhere; where a server has no room for a session, each step is a solve of its
  /// own. `controls` as marble::solve_coupled has them; without a runner up to 64 threads wait for the
  /// servers. In process it is marble::solve_coupled. Errors: as that has them, and what the servers say
  /// of a block that none of them takes; cancelled.
  [[nodiscard]] Expected<RemoteCoupledSolution> solve_coupled_by_sessions(
      const CoupledView& view, const CoupledOptions& options = {}, const CoupledControls& controls = {},
      const BlockSessions& sessions = {}) const;
  /// The same of a long horizon: marble::solve_in_pieces, whose pieces agree in sessions. Their first sweep,
  /// one after the other, is done in this process.
  [[nodiscard]] Expected<RemotePiecesSolution> solve_in_pieces_by_sessions(
      const Problem& problem, std::span<const Index> stage_of_variable, const PiecesOptions& options = {},
      const CoupledControls& controls = {}, const BlockSessions& sessions = {}) const;

  /// Jobs by their ids.
  [[nodiscard]] Jobs jobs() const;

  /// True if the server takes jobs, false if it drains. `stop` gives the question up, with the error
  /// cancelled.
  [[nodiscard]] Expected<bool> healthy(const std::stop_token& stop = {}) const;

  /// What the server tells about itself; of several servers one of them. `stop` as above.
  [[nodiscard]] Expected<ServerInfo> info(const std::stop_token& stop = {}) const;

  /// As it was given; "in process" without one.
  [[nodiscard]] const std::string& address() const;

 private:
  explicit Client(std::shared_ptr<const client::Connection> connection);
  [[nodiscard]] Expected<std::vector<Client>> each() const;
  std::shared_ptr<const client::Connection> connection_;
};

/// Solves on the server that MARBLE_SERVER names, and in this process where it names none or is "local": the
/// environment decides, not the program. A server that is named but away is an error, not a local solve. The
/// connection is kept for calls to come, as long as MARBLE_SERVER and what ConnectOptions reads of the
/// environment stay. All else as Client::solve. Thread-safe.
[[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options = {},
                                             const SolveControls& controls = {},
                                             const CallControls& call = {});

}  // namespace marble
