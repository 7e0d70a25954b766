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
  MARBLE_ASSIGN_OR_RETURN(const auto table, read(name));
  if (!table) return std::vector<double>(size, 0.0);
  return vector_of(*table, size, name);
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
  MARBLE_ASSIGN_OR_RETURN(const auto Q, read("Q"));
  if (!Q) return missing("Q");
  const auto n = static_cast<std::size_t>(std::max(Q->rows, Q->columns));
  MARBLE_ASSIGN_OR_RETURN(problem.Q, compress(Q->rows, Q->columns, Q->entries, "Q"));
  if (const auto g = read("g"); g && !*g) return missing("g");
  MARBLE_ASSIGN_OR_RETURN(problem.g, read_vector(read, "g", n));
  for (const BlockNames& block : kBlocks) {
    MARBLE_ASSIGN_OR_RETURN(const auto matrix, read(block.matrix));
    const Index rows = matrix ? matrix->rows : 0;
    MARBLE_ASSIGN_OR_RETURN(problem.*block.matrix_part,
                            matrix ? compress(rows, matrix->columns, matrix->entries, block.matrix)
                                   : compress(0, static_cast<Index>(n), {}, block.matrix));
    MARBLE_ASSIGN_OR_RETURN(problem.*block.vector_part,
                            read_vector(read, block.vector, static_cast<std::size_t>(rows)));
  }
  MARBLE_ASSIGN_OR_RETURN(const auto c0, read_vector(read, "c0", 1));
  problem.c0 = c0.front();
  MARBLE_ASSIGN_OR_RETURN(const auto x0_table, read("x0"));
  if (x0_table) {
    MARBLE_ASSIGN_OR_RETURN(problem.initial_z, vector_of(*x0_table, n, "x0"));
  }
  MARBLE_RETURN_IF_ERROR(Problem::create(problem.view()));
  MARBLE_RETURN_IF_ERROR(Problem::check_initial_point(problem.initial_z, static_cast<Index>(n)));
  return file;
}

Expected<void> write_tables(const ProblemFile& file, const TableSink& sink) {
  const OwnedProblem& problem = file.problem;
  MARBLE_RETURN_IF_ERROR(sink.matrix("Q", in_full(problem)));
  MARBLE_RETURN_IF_ERROR(sink.vector("g", problem.g));
  for (const BlockNames& block : kBlocks) {
    if ((problem.*block.vector_part).empty()) continue;
    MARBLE_RETURN_IF_ERROR(sink.matrix(block.matrix, problem.*block.matrix_part));
    MARBLE_RETURN_IF_ERROR(sink.vector(block.vector, problem.*block.vector_part));
  }
  if (problem.c0 != 0.0) {
    MARBLE_RETURN_IF_ERROR(sink.vector("c0", {problem.c0}));
  }
  return problem.initial_z.empty() ? Expected<void>() : sink.vector("x0", problem.initial_z);
}

}  // namespace marble::formats
