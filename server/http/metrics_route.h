// GET /metrics, for Prometheus. Needs the role observe.
#pragma once

#include "service_parts.h"

namespace httplib {
class Server;
}

namespace marble::server::http {

/// Nothing is there if metrics are off.
void add_metrics_route(httplib::Server& server, const ServiceParts& parts);

}  // namespace marble::server::http
