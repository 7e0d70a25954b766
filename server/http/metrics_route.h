// GET /metrics, for Prometheus. Needs the role observe.
#pragma once

#include "http/router.h"
#include "service/service_parts.h"

namespace marble::server::http {

/// Adds nothing if metrics are off.
void add_metrics_route(Router& router, const ServiceParts& parts);

}  // namespace marble::server::http
