// The work of a worker for a request of many problems: one plan for many scenarios.
#pragma once

#include <memory>

#include "config/config.h"
#include "jobs/job.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

/// Sets the job's work and what its solution contains besides. Checks everything in `request.scenarios`; the
/// work keeps the request, whose problem and options are valid. Error fields are paths from the request's
/// root. Errors: invalid_argument; resource_exhausted (more scenarios than the server allows, or than fit
/// into the memory of one solver).
[[nodiscard]] Expected<void> set_scenario_work(const Config& config,
                                               std::shared_ptr<const v1::SolveRequest> request,
                                               const Options& options, Job& job);

}  // namespace marble::server
