// What the calls answer alike.
#pragma once

#include <grpcpp/support/status.h>

#include "jobs/progress_slot.h"
#include "marble/v1/service.pb.h"
#include "queue/job.h"

namespace marble::server {

/// The answer with what the service adds to it: the options in force and the times around the solve.
void fill_solution(const Outcome& outcome, const Options& options, v1::Solution* message);

/// Fills the response from a job's outcome, or tells the error it ended with.
[[nodiscard]] Expected<void> fill_response(const JobRecord& job, const Outcome& outcome,
                                           v1::SolveResponse* response);

/// The rows with the newest one's iterate.
void fill_rows(const ProgressSlot::Rows& taken, const JobRecord& record, v1::ProgressRows* message);

}  // namespace marble::server
