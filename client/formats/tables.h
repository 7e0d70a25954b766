// Provides the parts of a problem as named tables, in Marble's own terms: the content of .npz files and
// Matrix Market folders.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "marble/problem_file.h"

namespace marble::formats {

/// A matrix, or a vector as one of its rows or columns. The creator has checked that entries lie within it.
struct TableMatrix {
  Index rows = 0, columns = 0;
  Triplets entries = {};
};

/// Returns the table with that name; nothing if there is none.
using TableReader = std::function<Expected<std::optional<TableMatrix>>(const char* name)>;

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
