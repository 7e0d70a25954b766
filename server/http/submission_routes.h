// The submitted jobs of the HTTP port: a problem in, its answer out, both let go.
#pragma once

#include "http/requests/places.h"
#include "http/requests/router.h"
#include "service/service_parts.h"

namespace marble::server::http {

constexpr const char* kJobsPath = "/api/jobs";

void add_submission_routes(Router& router, const ServiceParts& parts, Places& places);

}  // namespace marble::server::http
