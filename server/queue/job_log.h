// The log's lines about requests and jobs: each says whose it is, and to which trace it belongs.
#pragma once

#include <optional>

#include "access/origin.h"
#include "log/log.h"
#include "queue/job.h"

namespace marble::server {

/// A request that did not become a job.
void log_refusal(const Log& log, const Origin& origin, const Error& error);

/// A job that has ended; of a session's update at debug.
void log_end(const Log& log, const Job& job, const Outcome& outcome);

/// An array that has ended: why before its last element, if so.
void log_array_end(const Log& log, const JobRecord& record, const std::optional<Error>& reason);

/// A session that is set up.
void log_session_open(const Log& log, const JobRecord& record);
/// One that is over: why, unless its client closed it.
void log_session_end(const Log& log, const JobRecord& record, const std::optional<Error>& reason);

}  // namespace marble::server
