// Reads MATLAB's files of version 7.3, which are HDF5.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::formats {

[[nodiscard]] bool is_mat73(std::string_view bytes);

/// Reads as read_mat. libmatio and HDF5 run in a child process with bounds on memory and time: a broken file
/// can only end that process. `length` is the file's.
[[nodiscard]] Expected<ProblemFile> read_mat73(const std::string& path, const std::string& name,
                                               std::size_t length);

}  // namespace marble::formats
