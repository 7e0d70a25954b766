// The servers that share a store, for the page.
#pragma once

#include <string>

#include "http/router.h"
#include "service/service_parts.h"

namespace marble::server::http {

/// {"shared", "waiting", "age_s", "error", "servers": […]}. Without a shared store: {"shared": false}.
[[nodiscard]] std::string servers_json(const ServiceParts& parts);

/// Adds /api/servers, for the roles observe and admin.
void add_fleet_routes(Router& router, const ServiceParts& parts);

}  // namespace marble::server::http
