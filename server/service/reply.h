// Parts of replies that several calls share.
#pragma once

#include <grpcpp/support/status.h>

#include "jobs/job.h"
#include "jobs/progress_slot.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

/// Writes the solution and what the service adds to it: the options in force and the times around the solve.
void fill_solution(const Outcome& outcome, const Options& options, v1::Solution* message);

/// Fills the response from a job's outcome, or returns its error.
[[nodiscard]] Expected<void> fill_response(const JobRecord& job, const Outcome& outcome,
                                           v1::SolveResponse* response);

/// Writes the rows, with the newest one's iterate.
void fill_rows(const ProgressSlot::Rows& taken, const JobRecord& record, v1::ProgressRows* message);

}  // namespace marble::server
