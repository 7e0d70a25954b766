// Counts every call of the gRPC server, of any service.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <memory>
#include <vector>

#include "metrics/metric_registry.h"

namespace marble::server {

/// For the server's builder. The registry must outlive the server.
[[nodiscard]] std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>>
rpc_interceptors(MetricRegistry& registry);

}  // namespace marble::server
