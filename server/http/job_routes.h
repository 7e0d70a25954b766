// /api/info and /api/jobs: the data of Server.GetInfo and of Jobs.List, Get and Cancel as JSON.
#pragma once

#include "http/router.h"
#include "http/semaphore.h"
#include "service/service_parts.h"

namespace marble::server::http {

void add_job_routes(Router& router, const ServiceParts& parts, Semaphore& semaphore);

}  // namespace marble::server::http
