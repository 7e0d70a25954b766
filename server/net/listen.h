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
  std::shared_ptr<grpc::ServerCredentials> credentials;  ///< used by the server until its end
  std::unique_ptr<grpc::Server> server;
  std::unique_ptr<Acceptor> acceptor;  ///< must be stopped before the server
  std::vector<std::string> addresses;  ///< as configured, with the assigned port in place of 0
};

/// Returns the limits from these settings and from the process's limit on descriptors.
[[nodiscard]] ConnectionLimits connection_limits(const Config& config);

/// Starts serving the services, health and reflection. The error's value is the address that could not be
/// bound. Configuration, log, metrics and connections must outlive the server.
[[nodiscard]] Expected<Listening> listen(const Config& config, const std::vector<grpc::Service*>& services,
                                         const Log& log, Metrics& metrics, ConnectionTable& connections);

/// Sets the health status of every service.
void set_serving(const grpc::Server& server, bool serving);

}  // namespace marble::server
