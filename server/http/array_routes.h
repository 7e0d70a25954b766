// Results of arrays on the HTTP port, page by page.
#pragma once

#include "http/router.h"
#include "http/semaphore.h"
#include "service/service_parts.h"

namespace marble::server::http {

void add_array_routes(Router& router, const ServiceParts& parts, Semaphore& semaphore);

}  // namespace marble::server::http
