// TLS for the addresses of the gRPC server.
#pragma once

#include <grpcpp/security/server_credentials.h>

#include <memory>

#include "config/settings.h"
#include "log/log.h"

namespace marble::server {

/// Returns credentials that read the certificate files before every handshake, so that renewed ones take
/// effect at once. Invalid files are logged, and the last valid ones stay in use. Both arguments must
/// outlive the server, and so must the credentials, unlike those of gRPC itself.
[[nodiscard]] std::shared_ptr<grpc::ServerCredentials> tls_credentials(const Settings& settings,
                                                                       const Log& log);

}  // namespace marble::server
