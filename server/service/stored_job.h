// Converts rows of the stores to the server's types. A row may contain anything: what cannot be read is an
// error of that job alone.
#pragma once

#include <memory>
#include <string_view>

#include "jobs/job_board.h"
#include "jobs/result_store.h"
#include "store/job_store.h"

namespace marble::server {

/// Returns the job's description. The row's own columns take precedence; `info`, a marble.v1.JobInfo,
/// provides the rest if it can be read.
[[nodiscard]] JobDescription description_of(const StoredJob& stored, std::string_view info);

/// Returns the error of a job that does not run again because too many servers died while running it.
[[nodiscard]] Error set_aside(int starts);
void log_set_aside(const Log& log, const StoredJob& stored, int starts);

/// Returns the job's state from `info`; it contains an error if `info` cannot be read.
[[nodiscard]] JobSnapshot stored_snapshot(std::string_view info);

/// Returns the record of a job with a result, not on the board yet; without numbers if they cannot be read.
[[nodiscard]] JobBoard::Record stored_record(const JobBoard& board, const StoredResult& stored);

/// Errors: internal (not a marble.v1.SolveRequest).
[[nodiscard]] Expected<std::shared_ptr<v1::SolveRequest>> stored_request(std::string_view bytes);

/// Reads a marble.v1.SolveResponse, or the google.rpc.Status of a job without one; an internal error if
/// neither can be read.
[[nodiscard]] ResultStore::Result stored_answer(std::string_view answer, std::string_view error);

}  // namespace marble::server
