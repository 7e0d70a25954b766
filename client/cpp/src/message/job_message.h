// Converts messages to jobs.
#pragma once

#include "marble/jobs.h"
#include "marble/v1/job.pb.h"

namespace marble::client {

[[nodiscard]] JobInfo job_info(const v1::JobInfo& message);
[[nodiscard]] std::vector<Progress> progress_rows(
    const google::protobuf::RepeatedPtrField<v1::Progress>& rows);
[[nodiscard]] JobTrace job_trace(const v1::Trace& message);
[[nodiscard]] Infeasibility infeasibility(const v1::Infeasibility& message);
[[nodiscard]] v1::JobState to_message(JobState state);

}  // namespace marble::client
