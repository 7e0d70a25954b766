// What unary and streamed solves answer alike.
#pragma once

#include <grpcpp/support/status.h>

#include "job.h"
#include "log.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

/// Fills the response from a job's outcome, or tells the status of the error it ended with.
[[nodiscard]] grpc::Status fill_response(const Job& job, const Outcome& outcome, v1::SolveResponse* response);

/// One log line for a request that did not become a job.
void log_refusal(const Log& log, const std::string& peer, const std::string& request_id, const Error& error);

}  // namespace marble::server
