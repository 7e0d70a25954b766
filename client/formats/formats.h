// Reads and writes problems in every format of the tools, selected by the path's extension:
//   .json, .pb, .bin  marble/problem_file.h      .npz  npz_problem.h      a folder, or NAME/  matrix_market.h
//   .nl               nl_problem.h (read only)
#pragma once

#include <string>

#include "marble/problem_file.h"

namespace marble::formats {

/// The note on a file whose maximum becomes a problem that minimizes.
inline constexpr const char* kNegativeOfMaximum = "is a maximum: its negative is minimized";

/// Reads a file; "-" is standard input, JSON or binary. Errors name the field and the index in the format's
/// own terms, and the bound. A .mat file is an error that names the command that converts it.
[[nodiscard]] Expected<ProblemFile> read_any_problem(const std::string& path);

/// Checks that the path names a format that can be written.
[[nodiscard]] Expected<void> check_writable_format(const std::string& path);
/// Errors: invalid_argument (the path names no format that can be written), unavailable (the file cannot be
/// written).
[[nodiscard]] Expected<void> write_any_problem(const ProblemFile& file, const std::string& path);
/// True if the format stores x0; only JSON stores best_known_objective.
[[nodiscard]] bool keeps_initial_point(const std::string& path);

}  // namespace marble::formats
