// Submitted jobs on the HTTP port: submits a problem, returns its result, deletes both.
#pragma once

#include "http/requests/places.h"
#include "http/requests/router.h"
#include "service/service_parts.h"

namespace marble::server::http {

constexpr const char* kJobsPath = "/api/jobs";

void add_submission_routes(Router& router, const ServiceParts& parts, Places& places);

}  // namespace marble::server::http
