// Builds problems in LCQPow's terms: named matrices and vectors.
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

/// See read_mat.
[[nodiscard]] Expected<ProblemFile> assemble_lcqpow(const TableReader& read, const std::string& name);

/// Returns the table's numbers if it is a row or a column of `size` of them; `field` names it in the error.
[[nodiscard]] Expected<std::vector<double>> vector_of(const TableMatrix& table, std::size_t size,
                                                      const std::string& field);

}  // namespace marble::formats
