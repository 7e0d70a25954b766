// NumPy's .npz files.
//
// Arrays are named as tables.h names the parts. A matrix is one two-dimensional array, or sparse as SciPy
// keeps it: "Q.data", "Q.indices", "Q.indptr", "Q.shape" and, if it is not "csc", "Q.format" = "csr". Names
// with "_" in place of "." are read too: keyword arguments of numpy.savez cannot have points.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "marble/problem_file.h"
#include "npz/npy.h"

namespace marble::formats {

/// Errors name the array; not_found if the file cannot be read. Memory is in proportion to the file's length
/// (file_limits.h).
[[nodiscard]] Expected<ProblemFile> read_npz(const std::string& path, const std::string& name);
/// The same of a file's bytes.
[[nodiscard]] Expected<ProblemFile> parse_npz(std::string_view bytes, const std::string& name);
/// Every array of a file by its name, whatever it is.
[[nodiscard]] Expected<std::map<std::string, NpyArray>> read_npz_arrays(const std::string& path);
[[nodiscard]] Expected<void> write_npz(const ProblemFile& file, const std::string& path);

}  // namespace marble::formats
