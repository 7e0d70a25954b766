// What is told of one solved file: a summary for people, a JSON line for programs.
#pragma once

#include <optional>
#include <string>

#include "marble/problem_file.h"
#include "marble/solution.h"

namespace marble::cli {

struct Answer {
  Solution solution;
  double queue_s = 0.0;
  std::string job_id;  ///< empty for a local solve
};

/// Several lines: status, objective, violations, work, times.
[[nodiscard]] std::string summary(const std::string& file, const ProblemFile& problem, const Answer& answer);

/// One JSON object without a line break.
[[nodiscard]] std::string json_line(const std::string& file, const ProblemFile& problem,
                                    const Answer& answer);
[[nodiscard]] std::string json_line(const std::string& file, const Error& error);

}  // namespace marble::cli
