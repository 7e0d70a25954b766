#include "marble/client.h"

#include <cstdlib>
#include <memory>
#include <new>

#include "connection/connection.h"
#include "marble/contract.h"
#include "marble/pending_solution.h"
#include "message/status.h"
#include "mutex.h"
#include "pending_solve.h"
#include "transport.h"

namespace marble {

Expected<Client> Client::connect(const std::string& address, const ConnectOptions& options) {
  if (address == contract::local_address) return in_process();
  MARBLE_ASSIGN_OR_RETURN(auto connection, client::Connection::open(address, options));
  return Client(client::remote_transport(std::move(connection)));
}

Client Client::in_process() { return Client(client::local_transport()); }

Client::Client(std::shared_ptr<const client::Transport> transport) : transport_(std::move(transport)) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Expected<RemoteSolution> Client::solve(const ProblemView& problem, const Options& options,
                                       const SolveControls& controls, const CallControls& call) const {
  return or_out_of_memory([&] { return transport_->solve(problem, options, controls, call); });
}

Expected<PendingSolution> Client::solve_async(const ProblemView& problem, const Options& options,
                                              const SolveControls& controls, const CallControls& call) const {
  return or_out_of_memory([&] { return transport_->solve_async(problem, options, controls, call); });
}

Expected<RemoteScenarios> Client::solve_scenarios(const ScenarioProblem& problem,
                                                  const ScenarioSettings& settings,
                                                  const SolveControls& controls,
                                                  const CallControls& call) const {
  return or_out_of_memory(
      [&] { return transport_->solve_scenarios(problem, nullptr, settings, controls, call); });
}

Expected<RemoteScenarios> Client::solve_scenarios(ScenarioProblem problem, const ScenarioSampler& sampler,
                                                  const ScenarioSettings& settings,
                                                  const SolveControls& controls,
                                                  const CallControls& call) const {
  MARBLE_RETURN_IF_ERROR(set_scenarios(problem, sampler));
  return or_out_of_memory(
      [&] { return transport_->solve_scenarios(problem, &sampler, settings, controls, call); });
}

Expected<void> Client::solve_batch(const BatchSource& source, const BatchSink& sink,
                                   const BatchControls& controls) const {
  return transport_->solve_batch(source, sink, controls);
}

Expected<void> Client::solve_batch(std::span<const BatchProblem> problems, const BatchSink& sink,
                                   const BatchControls& controls) const {
  std::size_t next = 0;
  const BatchSource source = [&]() -> std::optional<BatchProblem> {
    if (next == problems.size()) return std::nullopt;
    return problems[next++];
  };
  return solve_batch(source, sink, controls);
}

Expected<Session> Client::open_session(const ProblemView& problem, const Options& options,
                                       const SessionOptions& session) const {
  return or_out_of_memory([&]() -> Expected<Session> {
    if (const double grace_s = session.answer_grace.count(); !(grace_s >= 0.0 && grace_s <= 3600.0))
      return unexpected(invalid("answer_grace", std::to_string(grace_s), "must be in [0, 3600] seconds"));
    MARBLE_ASSIGN_OR_RETURN(auto state, transport_->open_session(problem, options, session));
    return Session(std::move(state));
  });
}

Expected<RemoteCoupledSolution> Client::solve_coupled(const CoupledView& view, const CoupledOptions& options,
                                                      const CoupledControls& controls,
                                                      const CallControls& call) const {
  return or_out_of_memory([&] { return transport_->solve_coupled(view, options, controls, call); });
}

Expected<RemoteSegmentsSolution> Client::solve_in_segments(const Problem& problem,
                                                           std::span<const Index> stage_of_variable,
                                                           const SegmentsOptions& options,
                                                           const CoupledControls& controls,
                                                           const CallControls& call) const {
  return or_out_of_memory(
      [&] { return transport_->solve_in_segments(problem, stage_of_variable, options, controls, call); });
}

Jobs Client::jobs() const { return Jobs(transport_->connection()); }
Expected<bool> Client::healthy(const std::stop_token& stop) const { return transport_->healthy(stop); }
Expected<ServerInfo> Client::info(const std::stop_token& stop) const { return transport_->info(stop); }
const std::string& Client::address() const { return transport_->address(); }

namespace {

// One client per process: a connection per solve would cost more than a small solve.
class EnvironmentClient {
 public:
  [[nodiscard]] Expected<std::shared_ptr<const Client>> get() {
    const char* const named = std::getenv("MARBLE_SERVER");
    const std::string address = named != nullptr && *named != '\0' ? named : contract::local_address;
    const ConnectOptions options = ConnectOptions::from_environment();
    const MutexLock lock(mutex_);
    if (client_ != nullptr && address == address_ && options == options_) return client_;
    MARBLE_ASSIGN_OR_RETURN(auto connected, Client::connect(address, options));
    client_ = std::make_shared<const Client>(std::move(connected));
    address_ = address;
    options_ = options;
    return client_;
  }

 private:
  Mutex mutex_;
  std::string address_ ABSL_GUARDED_BY(mutex_);
  ConnectOptions options_ ABSL_GUARDED_BY(mutex_);
  std::shared_ptr<const Client> client_ ABSL_GUARDED_BY(mutex_);  // running calls keep an older one
};

}  // namespace

Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options,
                               const SolveControls& controls, const CallControls& call) {
  static EnvironmentClient environment;
  MARBLE_ASSIGN_OR_RETURN(const auto client, environment.get());
  return client->solve(problem, options, controls, call);
}

PendingSolution::PendingSolution(std::unique_ptr<State> state) : state_(std::move(state)) {}
PendingSolution::PendingSolution(PendingSolution&&) noexcept = default;

PendingSolution& PendingSolution::operator=(PendingSolution&& other) noexcept {
  PendingSolution taken(std::move(other));
  std::swap(state_, taken.state_);  // cancels the overwritten solve
  return *this;
}

PendingSolution::~PendingSolution() {
  if (state_ == nullptr) return;
  state_->cancel();
  state_->wait();
}

Expected<RemoteSolution> PendingSolution::get() {
  return or_out_of_memory([&]() -> Expected<RemoteSolution> {
    state_->wait();
    if (state_->taken)
      return unexpected(failure(ErrorCode::failed_precondition, "the answer was taken already"));
    state_->taken = true;
    return state_->answer();
  });
}

bool PendingSolution::wait_for(std::chrono::duration<double> longest) const { return state_->wait(longest); }

void PendingSolution::cancel() { state_->cancel(); }

}  // namespace marble
