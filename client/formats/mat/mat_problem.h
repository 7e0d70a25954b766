// Reads MATLAB's .mat files with LCQPow's names for the parts of a problem.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::formats {

/// Reads min ½ xᵀQx + gᵀx  s.t.  0 <= L x − lbL ⊥ R x − lbR >= 0,  lbA <= A x <= ubA,  lb <= x <= ub:
/// variables Q, g, L, R, lbL, lbR, ubL, ubR, A, lbA, ubA, lb, ub, x0 of a v4, v5, v6, v7 or v7.3 file, dense
/// or sparse doubles. Q and g are required; absent bounds are infinite, absent lbL and lbR zero. Other
/// variables are ignored. Errors name the variable and its fault; not_found if the file cannot be read.
/// Memory is proportional to the file's length (file_limits.h).
[[nodiscard]] Expected<ProblemFile> read_mat(const std::string& path, const std::string& name);

/// The same for a file's bytes, of any version but 7.3.
[[nodiscard]] Expected<ProblemFile> parse_mat(std::string_view bytes, const std::string& name);

}  // namespace marble::formats
