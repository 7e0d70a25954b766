// Requests about jobs, for gRPC and HTTP.
#pragma once

#include "base/identity.h"
#include "jobs/job_board.h"
#include "marble/v1/job.pb.h"

namespace marble::server {

/// Errors: invalid_argument, not_found (the job to continue from).
[[nodiscard]] Expected<void> list_jobs(const JobBoard& board, const Identity& caller,
                                       const v1::ListJobsRequest& request, v1::ListJobsResponse* response);
/// Errors: not_found.
[[nodiscard]] Expected<void> get_job(const JobBoard& board, const Identity& caller, const std::string& id,
                                     v1::GetJobResponse* response);
/// Errors: not_found, permission_denied.
[[nodiscard]] Expected<void> cancel_job(const JobBoard& board, const Identity& caller, const std::string& id,
                                        v1::CancelJobResponse* response);

}  // namespace marble::server
