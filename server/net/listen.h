// The gRPC server on its addresses.
#pragma once

#include <grpcpp/server.h>

#include <memory>
#include <string>
#include <vector>

#include "config/config.h"
#include "log/log.h"
#include "marble/error.h"
#include "metrics/metrics.h"
#include "net/acceptor.h"
#include "net/connection_table.h"

namespace marble::server {

struct Listening {
  std::shared_ptr<grpc::ServerCredentials> credentials;  ///< used by the server to its end
  std::unique_ptr<grpc::Server> server;
  std::unique_ptr<Acceptor> acceptor;  ///< to be stopped before the server
  std::vector<std::string> addresses;  ///< as configured, with the port that was taken in place of 0
};

/// Of these settings, and of the descriptors that the process may have.
[[nodiscard]] ConnectionLimits connection_limits(const Config& config);

/// Starts serving the services, health and reflection. The error's value is the address that could not be
/// had. Configuration, log, metrics and connections must outlive the server.
[[nodiscard]] Expected<Listening> listen(const Config& config, const std::vector<grpc::Service*>& services,
                                         const Log& log, Metrics& metrics, ConnectionTable& connections);

/// Tells health checkers of every service whether to send work here.
void set_serving(const grpc::Server& server, bool serving);

}  // namespace marble::server
