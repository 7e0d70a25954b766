// Every format that the tools read and write problems in, by the path's extension:
//   .json, .pb, .bin  marble/problem_file.h      .npz  npz_problem.h      a folder, or NAME/  matrix_market.h
//   .mat              mat_problem.h (read only)  .nl   nl_problem.h (read only)
#pragma once

#include <string>

#include "marble/problem_file.h"

namespace marble::formats {

/// What is said where a file's maximum goes on as the problem that it becomes.
inline constexpr const char* kNegativeOfMaximum = "is a maximum: its negative is minimized";

/// "-" is standard input, JSON or binary. Errors name the field and the index as the format does, and the
/// bound.
[[nodiscard]] Expected<ProblemFile> read_any_problem(const std::string& path);

/// Whether the path names a format that can be written.
[[nodiscard]] Expected<void> check_writable_format(const std::string& path);
/// Errors: invalid_argument (the path names no format that can be written), unavailable (it cannot be
/// written).
[[nodiscard]] Expected<void> write_any_problem(const ProblemFile& file, const std::string& path);
/// True if the format has a place for x0; best_known_objective has one in JSON alone.
[[nodiscard]] bool keeps_initial_point(const std::string& path);

}  // namespace marble::formats
