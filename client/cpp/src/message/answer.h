// Converts messages to solutions.
#pragma once

#include "marble/call_controls.h"
#include "marble/convert.h"
#include "marble/v1/service.pb.h"

namespace marble::client {

[[nodiscard]] inline RemoteSolution remote_solution(const v1::Solution& solution, const std::string& job_id) {
  return {solution_of(solution), job_id, solution.times().queue_s(), solution.times().total_s(), 0, {}};
}

[[nodiscard]] inline RemoteSolution remote_solution(const v1::SolveResponse& response) {
  return remote_solution(response.solution(), response.job_id());
}

}  // namespace marble::client
