// Reads and writes problem files: JSON and the binary message marble.v1.Problem.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble {

/// The contents of a file.
struct ProblemFile {
  OwnedProblem problem;                        ///< validated
  std::optional<double> best_known_objective;  ///< JSON only, if the file has it
  bool maximize =
      false;  ///< .nl only: the file maximizes its objective, and the problem minimizes the negative
};

/// The format of a problem file.
enum class FileFormat {
  json,    ///< keys n, c0, g, Q, A, b, C, d, L, l, R, r, x0, name, best_known_objective; others are ignored
  binary,  ///< marble.v1.Problem; has no place for x0 and best_known_objective
};

/// Returns the format by the path's extension: .json is JSON; .pb and .bin are binary; others are an error.
[[nodiscard]] Expected<FileFormat> format_of_path(const std::string& path);

/// Returns the format by the first character: a brace or a bracket means JSON, everything else binary.
[[nodiscard]] FileFormat format_of_content(std::string_view content);

/// Parses and validates everything. Errors name the field and the index in the format's own terms ("A.j" in
/// JSON, "equality_matrix.row_indices" in the message) and the bound. A problem without a name gets `name`.
/// Never throws; returns resource_exhausted if there is too little memory.
[[nodiscard]] Expected<ProblemFile> parse_problem(std::string_view content, FileFormat format,
                                                  const std::string& name);

/// Reads a file; "-" is standard input. The content decides the format if the extension does not. Errors: as
/// parse_problem; not_found if the file cannot be read. A problem without a name gets the file's name.
[[nodiscard]] Expected<ProblemFile> read_problem(const std::string& path);

/// Reads a JSON file, whatever its name. A program that links only this function needs no gRPC.
[[nodiscard]] Expected<ProblemFile> read_json_problem(const std::string& path);

/// Returns one line of JSON, or the binary message. Doubles keep every bit. A Q given by its upper triangle
/// is written in full in JSON. The problem must be valid.
[[nodiscard]] std::string write_problem(const ProblemFile& file, FileFormat format);

}  // namespace marble
