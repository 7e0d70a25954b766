// Problems in files: JSON and the binary message marble.v1.Problem.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble {

struct ProblemFile {
  OwnedProblem problem;
  std::optional<double> best_known_objective;  ///< JSON only, where the file has it
};

enum class FileFormat { json, binary };

/// By its extension: .json is JSON; .pb and .bin are binary; nothing else is known.
[[nodiscard]] Expected<FileFormat> format_of_path(const std::string& path);

/// Parses and checks everything. Errors name the field as the format does ("A.j" in JSON), the index and the
/// bound. A problem without a name is called `name`.
[[nodiscard]] Expected<ProblemFile> parse_problem(std::string_view content, FileFormat format,
                                                  const std::string& name);

/// Reads a file; "-" is standard input. Binary content is told from JSON by its first byte where the path
/// tells nothing. Errors as parse_problem; not_found if it cannot be read.
[[nodiscard]] Expected<ProblemFile> read_problem(const std::string& path);

/// One line of JSON, or the binary message. Doubles keep every bit.
[[nodiscard]] std::string write_problem(const ProblemFile& file, FileFormat format);

}  // namespace marble
