// For probes without gRPC: /healthz says that the process answers, /readyz that it takes work. Open to all.
#pragma once

#include "http/router.h"
#include "service_parts.h"

namespace marble::server::http {

void add_health_routes(Router& router, const ServiceParts& parts);

}  // namespace marble::server::http
