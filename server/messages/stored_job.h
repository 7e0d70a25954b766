// Rows of the stores as what the server works with. A row may hold anything: what cannot be read is an error
// of that job alone.
#pragma once

#include <memory>
#include <string_view>

#include "jobs/job_board.h"
#include "jobs/result_store.h"
#include "store/job_store.h"

namespace marble::server {

/// The job's description. The row's own columns count; `info`, a marble.v1.JobInfo, says the rest where it
/// can be read.
[[nodiscard]] JobDescription description_of(const StoredJob& stored, std::string_view info);

/// Why a job that stopped so many servers does not run again.
[[nodiscard]] Error set_aside(int starts);
void log_set_aside(const Log& log, const StoredJob& stored, int starts);

/// What `info` says of the job; an error in it where it cannot be read.
[[nodiscard]] JobSnapshot stored_snapshot(std::string_view info);

/// The record of a job that has its answer, not on the board yet; without numbers where they cannot be read.
[[nodiscard]] JobBoard::Record stored_record(const JobBoard& board, const StoredResult& stored);

/// Errors: internal (not a marble.v1.SolveRequest).
[[nodiscard]] Expected<std::shared_ptr<v1::SolveRequest>> stored_request(std::string_view bytes);

/// A marble.v1.SolveResponse, or the google.rpc.Status why there is none; an internal error if neither can be
/// read.
[[nodiscard]] ResultStore::Result stored_answer(std::string_view answer, std::string_view error);

}  // namespace marble::server
