// Reads and writes NumPy's .npz files.
//
// Arrays have the names of tables.h. A matrix is one two-dimensional array, or sparse in SciPy's form:
// "Q.data", "Q.indices", "Q.indptr", "Q.shape" and, if it is not "csc", "Q.format" = "csr". Names with "_"
// instead of "." are read too: keyword arguments of numpy.savez cannot contain dots.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "marble/problem_file.h"
#include "npy.h"

namespace marble::formats {

/// Errors name the array; not_found if the file cannot be read. Memory is proportional to the file's length
/// (file_bytes.h).
[[nodiscard]] Expected<ProblemFile> read_npz(const std::string& path, const std::string& name);
/// The same for a file's bytes.
[[nodiscard]] Expected<ProblemFile> parse_npz(std::string_view bytes, const std::string& name);
/// Returns every array of a file by its name, whatever its type.
[[nodiscard]] Expected<std::map<std::string, NpyArray>> read_npz_arrays(const std::string& path);
[[nodiscard]] Expected<void> write_npz(const ProblemFile& file, const std::string& path);

}  // namespace marble::formats
