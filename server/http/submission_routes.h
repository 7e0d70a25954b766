// Submitted jobs on the HTTP port: submits a problem, returns its result, deletes both.
#pragma once

#include "http/router.h"
#include "http/semaphore.h"
#include "service/service_parts.h"

namespace marble::server::http {

constexpr const char* kJobsPath = "/api/jobs";

void add_submission_routes(Router& router, const ServiceParts& parts, Semaphore& semaphore);

}  // namespace marble::server::http
