// Converts jobs to messages.
#pragma once

#include "jobs/job_record.h"
#include "marble/v1/job.pb.h"

namespace marble::server {

void to_message(const JobRecord& record, v1::JobInfo* message);
void to_message(const JobRecord::Trace& trace, v1::Trace* message);
void to_message(const PairHistory::Frame& frame, v1::PairSides* message);
/// Writes everything that is reported of one job.
void to_message(const JobRecord& record, v1::GetJobResponse* message);
[[nodiscard]] v1::Priority to_message(Priority priority);

/// Reconstruct a finished job from its message.
[[nodiscard]] JobDescription description_of(const v1::JobInfo& message);
[[nodiscard]] JobSnapshot snapshot_of(const v1::JobInfo& message);
[[nodiscard]] JobSnapshot snapshot_of(const v1::GetJobResponse& message);
[[nodiscard]] JobRecord::Trace trace_of(const v1::Trace& message);

}  // namespace marble::server
