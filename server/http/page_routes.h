// The page and its data: / and /assets/NAME from the binary, and the recent history of the server.
#pragma once

#include "http/router.h"
#include "jobs/server_history.h"
#include "service/service_parts.h"

namespace marble::server::http {

void add_page_routes(Router& router);

/// Adds /api/history and /api/clients.
void add_recent_routes(Router& router, const ServiceParts& parts,
                       std::shared_ptr<const ServerHistory> history);

/// The timer updates it as long as it is kept.
[[nodiscard]] std::shared_ptr<const ServerHistory> begin_history(const ServiceParts& parts);

}  // namespace marble::server::http
