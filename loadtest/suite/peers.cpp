#include "peers.h"

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

namespace marble::suite {
namespace {

std::string list(const auto& values) {
  std::string text;
  char number[32];
  for (const auto value : values) {
    std::snprintf(number, sizeof number, "%s%.17g", text.empty() ? "" : ",", static_cast<double>(value));
    text += number;
  }
  return "[" + text + "]";
}

std::string part(const char* name, const SparseMatrix& m) {
  std::vector<Index> columns;
  for (Index j = 0; j < m.columns; ++j)
    columns.insert(columns.end(), static_cast<std::size_t>(m.column_pointers[j + 1] - m.column_pointers[j]),
                   j);
  return ", \"" + std::string(name) + "\": {\"rows\": " + std::to_string(m.rows) +
         ", \"cols\": " + std::to_string(m.columns) + ", \"i\": " + list(m.row_indices) +
         ", \"j\": " + list(columns) + ", \"v\": " + list(m.values) + "}";
}

std::string rows(const char* matrix, const SparseMatrix& m, const char* vector,
                 const std::vector<double>& offset) {
  return offset.empty() ? "" : part(matrix, m) + ", \"" + vector + "\": " + list(offset);
}

}  // namespace

void write_json(const OwnedProblem& p, const std::string& file) {
  char constant[32];
  std::snprintf(constant, sizeof constant, "%.17g", p.c0);
  std::ofstream(file) << "{\"n\": " << p.g.size() << ", \"c0\": " << constant << part("Q", p.Q)
                      << ", \"g\": " << list(p.g) << rows("A", p.A, "b", p.b) << rows("C", p.C, "d", p.d)
                      << rows("L", p.L, "l", p.l) << rows("R", p.R, "r", p.r) << "}\n";
}

}  // namespace marble::suite
