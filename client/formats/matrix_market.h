// Reads and writes folders of Matrix Market files: Q.mtx, g.mtx, A.mtx, b.mtx and so on, with the names of
// tables.h.
#pragma once

#include <map>
#include <string>

#include "marble/problem_file.h"

namespace marble::formats {

/// Reads coordinate or array files, real or integer, general or symmetric. Errors name the part; not_found if
/// a file cannot be read.
[[nodiscard]] Expected<ProblemFile> read_matrix_market(const std::string& folder, const std::string& name);

/// The contents of the files by the parts' names, such as "Q" for Q.mtx.
using MatrixMarketParts = std::map<std::string, std::string, std::less<>>;

/// The same for a folder's contents. Memory is proportional to their length (file_bytes.h).
[[nodiscard]] Expected<ProblemFile> parse_matrix_market(const MatrixMarketParts& parts,
                                                        const std::string& name);

/// Creates the folder if necessary. Numbers have all their digits. Removes files of parts that the problem
/// does not have, so that the folder is exactly this problem.
[[nodiscard]] Expected<void> write_matrix_market(const ProblemFile& file, const std::string& folder);

}  // namespace marble::formats
