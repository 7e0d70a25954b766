// For probes without gRPC: /healthz says that the process answers, /readyz that it takes work. Open to all.
#pragma once

#include "service_parts.h"

namespace httplib {
class Server;
}

namespace marble::server::http {

void add_health_routes(httplib::Server& server, const ServiceParts& parts);

}  // namespace marble::server::http
