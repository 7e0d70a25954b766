#include "peers.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

namespace marble::suite {

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
