// Problems in files: JSON and the binary message marble.v1.Problem.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble {

/// What a file holds.
struct ProblemFile {
  OwnedProblem problem;                        ///< checked
  std::optional<double> best_known_objective;  ///< JSON only, where the file has it
  bool maximize =
      false;  ///< .nl only: the file's objective is a maximum, and the problem minimizes its negative
};

/// How a problem is written down.
enum class FileFormat {
  json,    ///< keys n, c0, g, Q, A, b, C, d, L, l, R, r, x0, name, best_known_objective; others are ignored
  binary,  ///< marble.v1.Problem; has no place for x0 and best_known_objective
};

/// By its extension: .json is JSON; .pb and .bin are binary; nothing else is known.
[[nodiscard]] Expected<FileFormat> format_of_path(const std::string& path);

/// By how it starts: JSON starts with a brace or a bracket, everything else is taken for binary.
[[nodiscard]] FileFormat format_of_content(std::string_view content);

/// Parses and checks everything. Errors name the field and the index as the format does ("A.j" in JSON,
/// "equality_matrix.row_indices" in the message) and the bound. A problem without a name is called `name`.
/// Never throws; resource_exhausted if there is too little memory.
[[nodiscard]] Expected<ProblemFile> parse_problem(std::string_view content, FileFormat format,
                                                  const std::string& name);

/// Reads a file; "-" is standard input. The content decides the format where the extension does not. Errors
/// as parse_problem; not_found if it cannot be read. A problem without a name is called as its file.
[[nodiscard]] Expected<ProblemFile> read_problem(const std::string& path);

/// The same of a file that is JSON, whatever it is called. A program that links this alone needs no gRPC.
[[nodiscard]] Expected<ProblemFile> read_json_problem(const std::string& path);

/// One line of JSON, or the binary message. Doubles keep every bit. Q given by its upper triangle is written
/// in full in JSON. The problem must be valid.
[[nodiscard]] std::string write_problem(const ProblemFile& file, FileFormat format);

}  // namespace marble
