#include "marble/client.h"

#include <new>

#include "connection.h"
#include "pending_solve.h"
#include "solve.h"
#include "status.h"

namespace marble {

Expected<Client> Client::connect(const std::string& address, const ConnectOptions& options) {
  auto connection = client::Connection::open(address, options);
  if (!connection) return unexpected(connection.error());
  return Client(std::move(*connection));
}

Client::Client(std::shared_ptr<const client::Connection> connection) : connection_(std::move(connection)) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Expected<RemoteSolution> Client::solve(const ProblemView& problem, const Options& options,
                                       const SolveControls& controls, const CallControls& call) const try {
  return client::solve(*connection_, problem, options, controls, call);
} catch (const std::bad_alloc&) {
  return unexpected(client::out_of_memory());
}

Expected<PendingSolution> Client::solve_async(const ProblemView& problem, const Options& options,
                                              const SolveControls& controls, const CallControls& call) const
    try {
  return client::begin_solve(connection_, problem, options, controls, call);
} catch (const std::bad_alloc&) {
  return unexpected(client::out_of_memory());
}

Expected<Session> Client::open_session(const ProblemView& problem, const Options& options,
                                       const SessionOptions& session) const {
  return Session::open(connection_, problem, options, session);
}

Jobs Client::jobs() const { return Jobs(connection_); }

Expected<bool> Client::healthy(const std::stop_token& stop) const {
  grpc::ClientContext context;
  connection_->prepare(context, client::kQuickCall);
  const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = connection_->health().Check(&context, {}, &response);
  if (!status.ok()) return unexpected(client::to_error(status, stop));
  return response.status() == grpc::health::v1::HealthCheckResponse::SERVING;
}

const std::string& Client::address() const { return connection_->address(); }

}  // namespace marble
