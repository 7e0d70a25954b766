// Folders of Matrix Market files: Q.mtx, g.mtx, A.mtx, b.mtx and so on, as tables.h names the parts.
#pragma once

#include <map>
#include <string>

#include "marble/problem_file.h"

namespace marble::formats {

/// Coordinate or array files, real or integer, general or symmetric. Errors name the part; not_found if a
/// file cannot be read.
[[nodiscard]] Expected<ProblemFile> read_matrix_market(const std::string& folder, const std::string& name);

/// The contents of the files by the parts' names, "Q" for Q.mtx.
using MatrixMarketParts = std::map<std::string, std::string, std::less<>>;

/// The same of a folder's contents. Memory is in proportion to their length (file_limits.h).
[[nodiscard]] Expected<ProblemFile> parse_matrix_market(const MatrixMarketParts& parts,
                                                        const std::string& name);

/// Makes the folder if it is not there. Numbers have all their digits. Files of parts that the problem does
/// not have are removed: the folder is this problem.
[[nodiscard]] Expected<void> write_matrix_market(const ProblemFile& file, const std::string& folder);

}  // namespace marble::formats
