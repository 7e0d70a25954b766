// Provides the parts of a problem as named tables, in Marble's own terms: the content of .npz files and
// Matrix Market folders.
#pragma once

#include <functional>
#include <string>

#include "marble/problem_file.h"
#include "parts/lcqpow_problem.h"

namespace marble::formats {

/// Assembles Q, A, C, L, R, and the vectors g, b, d, l, r, c0 and x0, by their names in the JSON format. Q
/// and g are required; absent parts are empty, absent vectors of present parts zero.
[[nodiscard]] Expected<ProblemFile> assemble_tables(const TableReader& read, const std::string& name);

/// One part to write: a matrix, or a vector.
struct TableSink {
  std::function<Expected<void>(const char* name, const SparseMatrix& matrix)> matrix;
  std::function<Expected<void>(const char* name, const std::vector<double>& vector)> vector;
};

/// Passes every part that is not empty to the sink; Q in full.
[[nodiscard]] Expected<void> write_tables(const ProblemFile& file, const TableSink& sink);

}  // namespace marble::formats
