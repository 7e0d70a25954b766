// Reports the bytes of calls to the table of connections, so that it finds bytes that no call has taken.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <memory>

#include "net/connection_table.h"

namespace marble::server {

/// For the server's builder. The table must outlive the server.
[[nodiscard]] std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> connection_calls(
    ConnectionTable& connections);

}  // namespace marble::server
