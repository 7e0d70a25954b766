#include "tables.h"

#include <algorithm>
#include <span>

namespace marble::formats {
namespace {

struct BlockNames {
  const char *matrix, *vector;
  SparseMatrix OwnedProblem::*matrix_part;
  std::vector<double> OwnedProblem::*vector_part;
};

constexpr BlockNames kParts[] = {
#define MARBLE_MATRIX(letter, field, update, vector) \
  {#letter, #vector, &OwnedProblem::letter, &OwnedProblem::vector},
#include "marble/contract.def"
};
constexpr auto kBlocks = std::span(kParts).subspan<1>();  // all but Q and g, which determine n

// Returns the table's numbers if it is a row or a column of `size` of them; `field` names it in the error.
Expected<std::vector<double>> vector_of(const TableMatrix& table, std::size_t size,
                                        const std::string& field) {
  const bool row = table.rows == 1 && static_cast<std::size_t>(table.columns) == size;
  const bool column = table.columns == 1 && static_cast<std::size_t>(table.rows) == size;
  if (!row && !column) {
    return unexpected(invalid(field, std::to_string(table.rows) + " x " + std::to_string(table.columns),
                              "must have " + std::to_string(size) + " entries"));
  }
  std::vector<double> values(size, 0.0);
  for (std::size_t k = 0; k < table.entries.values.size(); ++k)
    values[static_cast<std::size_t>(std::max(table.entries.rows[k], table.entries.columns[k]))] =
        table.entries.values[k];
  return values;
}

Expected<std::vector<double>> read_vector(const TableReader& read, const char* name, std::size_t size) {
  const auto table = read(name);
  if (!table) return unexpected(table.error());
  if (!*table) return std::vector<double>(size, 0.0);
  return vector_of(**table, size, name);
}

// Fills in the other triangle.
SparseMatrix in_full(const OwnedProblem& problem) {
  if (problem.hessian_form == HessianForm::full) return problem.Q;
  Triplets entries;
  for (Index column = 0; column < problem.Q.columns; ++column) {
    const auto at = static_cast<std::size_t>(column);
    for (Index k = problem.Q.column_pointers[at]; k < problem.Q.column_pointers[at + 1]; ++k) {
      const Index row = problem.Q.row_indices[static_cast<std::size_t>(k)];
      const double value = problem.Q.values[static_cast<std::size_t>(k)];
      entries.add(row, column, value);
      if (row != column) entries.add(column, row, value);
    }
  }
  return compress(problem.Q.rows, problem.Q.columns, entries, "Q").value();
}

}  // namespace

Expected<ProblemFile> assemble_tables(const TableReader& read, const std::string& name) {
  ProblemFile file;
  OwnedProblem& problem = file.problem;
  problem.name = name;
  const auto missing = [](const char* what) { return unexpected(invalid(what, "is missing")); };
  const auto Q = read("Q");
  if (!Q) return unexpected(Q.error());
  if (!*Q) return missing("Q");
  const auto n = static_cast<std::size_t>(std::max((*Q)->rows, (*Q)->columns));
  auto compressed = compress((*Q)->rows, (*Q)->columns, (*Q)->entries, "Q");
  if (!compressed) return unexpected(compressed.error());
  problem.Q = std::move(*compressed);
  if (const auto g = read("g"); g && !*g) return missing("g");
  auto g = read_vector(read, "g", n);
  if (!g) return unexpected(g.error());
  problem.g = std::move(*g);
  for (const BlockNames& block : kBlocks) {
    const auto matrix = read(block.matrix);
    if (!matrix) return unexpected(matrix.error());
    const Index rows = *matrix ? (*matrix)->rows : 0;
    auto part = *matrix ? compress(rows, (*matrix)->columns, (*matrix)->entries, block.matrix)
                        : compress(0, static_cast<Index>(n), {}, block.matrix);
    if (!part) return unexpected(part.error());
    problem.*block.matrix_part = std::move(*part);
    auto vector = read_vector(read, block.vector, static_cast<std::size_t>(rows));
    if (!vector) return unexpected(vector.error());
    problem.*block.vector_part = std::move(*vector);
  }
  const auto c0 = read_vector(read, "c0", 1);
  if (!c0) return unexpected(c0.error());
  problem.c0 = c0->front();
  const auto x0_table = read("x0");
  if (!x0_table) return unexpected(x0_table.error());
  if (*x0_table) {
    auto x0 = vector_of(**x0_table, n, "x0");
    if (!x0) return unexpected(x0.error());
    problem.initial_z = std::move(*x0);
  }
  if (const auto valid = Problem::create(problem.view()); !valid) return unexpected(valid.error());
  if (auto valid = Problem::check_initial_point(problem.initial_z, static_cast<Index>(n)); !valid)
    return unexpected(valid.error());
  return file;
}

Expected<void> write_tables(const ProblemFile& file, const TableSink& sink) {
  const OwnedProblem& problem = file.problem;
  if (auto written = sink.matrix("Q", in_full(problem)); !written) return written;
  if (auto written = sink.vector("g", problem.g); !written) return written;
  for (const BlockNames& block : kBlocks) {
    if ((problem.*block.vector_part).empty()) continue;
    if (auto written = sink.matrix(block.matrix, problem.*block.matrix_part); !written) return written;
    if (auto written = sink.vector(block.vector, problem.*block.vector_part); !written) return written;
  }
  if (problem.c0 != 0.0) {
    if (auto written = sink.vector("c0", {problem.c0}); !written) return written;
  }
  return problem.initial_z.empty() ? Expected<void>() : sink.vector("x0", problem.initial_z);
}

}  // namespace marble::formats
