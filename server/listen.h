// The gRPC server on its addresses.
#pragma once

#include <grpcpp/server.h>

#include <memory>
#include <string>
#include <vector>

#include "config.h"
#include "log.h"
#include "marble/error.h"
#include "metrics/metrics.h"

namespace marble::server {

struct Listening {
  std::shared_ptr<grpc::ServerCredentials> credentials;  ///< used by the server to its end
  std::unique_ptr<grpc::Server> server;
  std::vector<std::string> addresses;  ///< as configured, with the port that was taken in place of 0
};

/// Starts serving the services, health and reflection. The error's value is the address that could not be
/// had. Configuration, log and metrics must outlive the server.
[[nodiscard]] Expected<Listening> listen(const Config& config, const std::vector<grpc::Service*>& services,
                                         const Log& log, Metrics& metrics);

/// Tells health checkers of every service whether to send work here.
void set_serving(const grpc::Server& server, bool serving);

}  // namespace marble::server
