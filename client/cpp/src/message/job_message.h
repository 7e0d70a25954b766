// Converts messages to jobs.
#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "marble/jobs.h"
#include "marble/v1/job.pb.h"

namespace marble::client {

[[nodiscard]] JobInfo job_info(const v1::JobInfo& message);
[[nodiscard]] std::vector<Progress> progress_rows(
    const google::protobuf::RepeatedPtrField<v1::Progress>& rows);
[[nodiscard]] JobTrace job_trace(const v1::Trace& message);
[[nodiscard]] Infeasibility infeasibility(const v1::Infeasibility& message);
[[nodiscard]] v1::JobState to_message(JobState state);

// Provides the id of a submission for which the caller gave none.

/// Returns 128 random bits: with them a repeated submission is the same job (SolveRequest.request_id).
[[nodiscard]] inline std::string random_request_id() {
  std::random_device random;
  std::string id = "submit-";
  for (int word = 0; word < 4; ++word) {
    const std::uint32_t bits = random();
    for (int digit = 0; digit < 8; ++digit) id += "0123456789abcdef"[(bits >> (4 * digit)) & 0xFU];
  }
  return id;
}

}  // namespace marble::client
