// The page and what it needs: / and /assets/NAME from the binary, and what the server did lately.
#pragma once

#include "http/requests/router.h"
#include "recent/server_history.h"
#include "service/service_parts.h"

namespace marble::server::http {

void add_page_routes(Router& router);

/// /api/history and /api/clients.
void add_recent_routes(Router& router, const ServiceParts& parts,
                       std::shared_ptr<const ServerHistory> history);

/// Is looked after by the pulse as long as it is kept.
[[nodiscard]] std::shared_ptr<const ServerHistory> begin_history(const ServiceParts& parts);

}  // namespace marble::server::http
