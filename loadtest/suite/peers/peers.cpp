#include "peers/peers.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <sstream>

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

Times read_peers(const std::filesystem::path& csv, const std::vector<Record>& ours) {
  constexpr double kUnsolved = std::numeric_limits<double>::infinity();
  Times times;
  std::ifstream file(csv);
  std::string line;
  std::getline(file, line);  // name,solver,status,objective,equality,inequality,complementarity,iterations,ms
  while (std::getline(file, line)) {
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    if (cells.size() < 9) continue;
    const auto record = std::ranges::find(ours, cells[0], &Record::problem);
    if (record == ours.end()) continue;
    auto& all = times.try_emplace(cells[1], ours.size(), kUnsolved).first->second;
    const double objective = std::stod(cells[3]);
    const double violation = std::max({std::stod(cells[4]), std::stod(cells[5]), std::stod(cells[6])});
    const double allowed = record->reference + 1e-3 * std::max(1.0, std::abs(record->reference));
    if (violation <= 1e-5 && objective <= allowed)
      all[static_cast<std::size_t>(record - ours.begin())] = std::stod(cells[8]);
  }
  if (times.empty()) return times;
  auto& own = times["marble"];
  for (const Record& r : ours) own.push_back(r.feasible() && r.gap() <= 1e-3 ? r.milliseconds : kUnsolved);
  return times;
}

}  // namespace marble::suite
