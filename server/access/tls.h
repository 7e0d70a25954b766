// TLS for the addresses of the gRPC server.
#pragma once

#include <grpcpp/security/server_credentials.h>

#include <memory>

#include "config/settings.h"
#include "log/log.h"

namespace marble::server {

/// Credentials that look at the certificate files before every handshake: renewed ones count from then on.
/// Files that are no good are logged and leave the last good ones in force. Both arguments must outlive the
/// server, and the credentials too: gRPC's do not.
[[nodiscard]] std::shared_ptr<grpc::ServerCredentials> tls_credentials(const Settings& settings,
                                                                       const Log& log);

}  // namespace marble::server
