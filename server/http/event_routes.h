// /api/events and /api/jobs/ID/events: server-sent events about jobs and the server.
#pragma once

#include "http/event_hub.h"
#include "http/router.h"

namespace marble::server::http {

void add_event_routes(Router& router, const ServiceParts& parts, EventHub& hub);

}  // namespace marble::server::http
