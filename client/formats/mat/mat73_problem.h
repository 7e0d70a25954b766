// MATLAB's files of version 7.3, which are HDF5.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::formats {

[[nodiscard]] bool is_mat73(std::string_view bytes);

/// As read_mat. libmatio and HDF5 read it, in a process of their own with bounds on memory and time: what
/// they do with a broken file is their own end alone. `length` is the file's.
[[nodiscard]] Expected<ProblemFile> read_mat73(const std::string& path, const std::string& name,
                                               std::size_t length);

}  // namespace marble::formats
