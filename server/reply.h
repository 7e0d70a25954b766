// What the calls answer alike.
#pragma once

#include <grpcpp/support/status.h>

#include "job.h"
#include "log.h"
#include "marble/v1/service.pb.h"
#include "progress_slot.h"

namespace marble::server {

/// The answer with what the service adds to it: the options in force and the times around the solve.
void fill_solution(const Outcome& outcome, const Options& options, v1::Solution* message);

/// Fills the response from a job's outcome, or tells the error it ended with.
[[nodiscard]] Expected<void> fill_response(const JobRecord& job, const Outcome& outcome,
                                           v1::SolveResponse* response);

/// The rows with the newest one's iterate.
void fill_rows(const ProgressSlot::Rows& taken, v1::ProgressRows* message);

/// One log line for a request that did not become a job.
void log_refusal(const Log& log, const std::string& peer, const std::string& request_id, const Error& error);

}  // namespace marble::server
