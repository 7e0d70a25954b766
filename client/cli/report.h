// What is told of one solved file: a summary for people, a JSON line for programs.
#pragma once

#include <string>

#include "marble/client.h"
#include "marble/problem_file.h"

namespace marble::cli {

/// An answer from here or from a server; the job is empty if from here.
using Answer = RemoteSolution;

/// Several lines: status, objective, violations, work, times.
[[nodiscard]] std::string summary(const ProblemFile& problem, const Answer& answer);

/// One JSON object without a line break.
[[nodiscard]] std::string json_line(const std::string& file, const ProblemFile& problem,
                                    const Answer& answer);
/// The same for a file without an answer; `name` is empty if it is not known.
[[nodiscard]] std::string json_line(const std::string& file, const std::string& name, const Error& error);

}  // namespace marble::cli
