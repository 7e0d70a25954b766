// Probes without gRPC: /healthz reports that the process responds, /readyz that it accepts work, which it
// tests by connecting to its own port. Open to all.
#pragma once

#include <vector>

#include "http/router.h"
#include "service/service_parts.h"

namespace marble::server::http {

/// `listeners` are the sockets of the gRPC port.
void add_health_routes(Router& router, const ServiceParts& parts, const std::vector<int>& listeners);

}  // namespace marble::server::http
