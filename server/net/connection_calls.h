// Tells the table of connections what calls take, so that bytes that none takes stand out.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <memory>

#include "net/connection_table.h"

namespace marble::server {

/// For the server's builder. The table must outlive the server.
[[nodiscard]] std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> connection_calls(
    ConnectionTable& connections);

}  // namespace marble::server
