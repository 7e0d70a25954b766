#include "marble/client.h"

#include <cstdlib>
#include <memory>

#include "connection/connection.h"
#include "handle/pending_solve.h"
#include "in_process/in_process.h"
#include "marble/contract.h"
#include "message/status.h"
#include "mutex.h"
#include "remote/coupled.h"
#include "remote/scenarios.h"
#include "remote/solve.h"

namespace marble {
Expected<Client> Client::connect(const std::string& address, const ConnectOptions& options) {
  if (address == contract::local_address) return in_process();
  auto connection = client::Connection::open(address, options);
  if (!connection) return unexpected(connection.error());
  return Client(std::move(*connection));
}

Client Client::in_process() { return Client(nullptr); }

Client::Client(std::shared_ptr<const client::Connection> connection) : connection_(std::move(connection)) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Expected<RemoteSolution> Client::solve(const ProblemView& problem, const Options& options,
                                       const SolveControls& controls, const CallControls& call) const {
  return or_out_of_memory([&] {
    if (connection_ == nullptr) return client::solve_locally(problem, options, controls, call);
    return client::solve_remotely(*connection_, problem, options, controls, call);
  });
}

Expected<PendingSolution> Client::solve_async(const ProblemView& problem, const Options& options,
                                              const SolveControls& controls, const CallControls& call) const {
  return or_out_of_memory([&] {
    if (connection_ == nullptr) return client::begin_solve_locally(problem, options, controls, call);
    return client::begin_solve(connection_, problem, options, controls, call);
  });
}

namespace {

Expected<RemoteScenarios> scenarios_by(const client::Connection* connection, const ScenarioProblem& problem,
                                       const ScenarioSampler* sampler, const ScenarioSettings& settings,
                                       const SolveControls& controls, const CallControls& call) {
  return or_out_of_memory([&]() -> Expected<RemoteScenarios> {
    if (connection != nullptr)
      return client::solve_scenarios_remotely(*connection, problem, sampler, settings, controls, call);
    auto answer = marble::solve_scenarios(problem, settings, controls);
    if (!answer) return unexpected(answer.error());
    if (answer->end == ScenarioEnd::cancelled) return unexpected(client::given_up());
    RemoteScenarios result;
    static_cast<ScenarioSolution&>(result) = *std::move(answer);
    return result;
  });
}

}  // namespace

Expected<RemoteScenarios> Client::solve_scenarios(const ScenarioProblem& problem,
                                                  const ScenarioSettings& settings,
                                                  const SolveControls& controls,
                                                  const CallControls& call) const {
  return scenarios_by(connection_.get(), problem, nullptr, settings, controls, call);
}

Expected<RemoteScenarios> Client::solve_scenarios(ScenarioProblem problem, const ScenarioSampler& sampler,
                                                  const ScenarioSettings& settings,
                                                  const SolveControls& controls,
                                                  const CallControls& call) const {
  if (auto set = set_scenarios(problem, sampler); !set) return unexpected(set.error());
  return scenarios_by(connection_.get(), problem, &sampler, settings, controls, call);
}

Expected<Session> Client::open_session(const ProblemView& problem, const Options& options,
                                       const SessionOptions& session) const {
  return Session::open(connection_, problem, options, session);
}

Expected<RemoteCoupledSolution> Client::solve_coupled(const CoupledView& view, const CoupledOptions& options,
                                                      const CoupledControls& controls,
                                                      const CallControls& call) const {
  return or_out_of_memory([&]() -> Expected<RemoteCoupledSolution> {
    if (connection_ != nullptr)
      return client::solve_coupled_remotely(*connection_, view, options, controls, call);
    auto solved = marble::solve_coupled(view, options, controls);
    if (!solved) return unexpected(solved.error());
    if (solved->joint.status == Status::cancelled) return unexpected(client::given_up());
    return RemoteCoupledSolution{*std::move(solved), {}};
  });
}

Expected<RemotePiecesSolution> Client::solve_in_pieces(const Problem& problem,
                                                       std::span<const Index> stage_of_variable,
                                                       const PiecesOptions& options,
                                                       const CoupledControls& controls,
                                                       const CallControls& call) const {
  return or_out_of_memory([&]() -> Expected<RemotePiecesSolution> {
    if (connection_ != nullptr)
      return client::solve_in_pieces_remotely(*connection_, problem, stage_of_variable, options, controls,
                                              call);
    auto solved = marble::solve_in_pieces(problem, stage_of_variable, options, controls);
    if (!solved) return unexpected(solved.error());
    if (solved->whole.status == Status::cancelled) return unexpected(client::given_up());
    return RemotePiecesSolution{*std::move(solved), {}};
  });
}

Jobs Client::jobs() const { return Jobs(connection_); }

Expected<bool> Client::healthy(const std::stop_token& stop) const {
  if (connection_ == nullptr) return true;
  grpc::ClientContext context;
  connection_->prepare(context, client::kQuickCall);
  const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = connection_->health().Check(&context, {}, &response);
  if (!status.ok()) return unexpected(client::to_error(status, stop));
  return response.status() == grpc::health::v1::HealthCheckResponse::SERVING;
}

const std::string& Client::address() const {
  static const std::string in_process = client::kInProcess;
  return connection_ == nullptr ? in_process : connection_->address();
}

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
    auto connected = Client::connect(address, options);
    if (!connected) return unexpected(connected.error());
    client_ = std::make_shared<const Client>(std::move(*connected));
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
  const auto client = environment.get();
  if (!client) return unexpected(client.error());
  return (*client)->solve(problem, options, controls, call);
}

}  // namespace marble
