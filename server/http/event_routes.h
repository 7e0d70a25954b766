// /api/events and /api/jobs/ID/events: server-sent events about jobs and the server.
#pragma once

#include "http/requests/event_hub.h"
#include "http/requests/router.h"

namespace marble::server::http {

void add_event_routes(Router& router, const ServiceParts& parts, EventHub& hub);

}  // namespace marble::server::http
