// Writes log lines about requests and jobs; each line contains the client and the trace.
#pragma once

#include <optional>

#include "base/origin.h"
#include "jobs/job.h"
#include "log/log.h"

namespace marble::server {

/// Logs a request that did not become a job.
void log_refusal(const Log& log, const Origin& origin, const Error& error);

/// Logs a job that has ended; at debug level for an update of a session.
void log_end(const Log& log, const Job& job, const Outcome& outcome);

/// Logs an array that has ended, and the reason if it ended before its last element.
void log_array_end(const Log& log, const JobRecord& record, const std::optional<Error>& reason);

/// Logs a session that is set up.
void log_session_open(const Log& log, const JobRecord& record);
/// Logs a session that has ended, and the reason unless its client closed it.
void log_session_end(const Log& log, const JobRecord& record, const std::optional<Error>& reason);

}  // namespace marble::server
