#include "jobs/infeasibility.h"

#include <algorithm>
#include <cmath>

namespace marble::server {
namespace {

constexpr double kNegligible = 1e-3;  // of the largest multiplier

}  // namespace

std::int64_t shorten(Conflict& conflict) {
  const std::size_t all = conflict.size();
  std::size_t room = Infeasibility::kMostParts;
  for (auto part : {&Conflict::equalities, &Conflict::inequalities, &Conflict::left_sides,
                    &Conflict::right_sides, &Conflict::complementarities}) {
    std::vector<Index>& rows = conflict.*part;
    if (rows.size() > room) rows = {rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(room)};
    room -= rows.size();
  }
  return static_cast<std::int64_t>(all - conflict.size());
}

std::shared_ptr<const Infeasibility> infeasibility_of(const Solution& solution, std::size_t rows) {
  if (solution.status != Status::infeasible) return nullptr;
  auto why = std::make_shared<Infeasibility>();
  if (solution.conflict) {
    why->conflict = solution.conflict;
    why->more_parts = shorten(*why->conflict);
  }
  const std::vector<double>& certificate = solution.certificate;
  if (certificate.size() != rows) return why;
  double largest = 0.0;
  for (const double multiplier : certificate) largest = std::max(largest, std::abs(multiplier));
  // The rows so far, largest first, the smallest of them replaced by each larger one.
  const auto is_larger = [](const Infeasibility::Row& a, const Infeasibility::Row& b) {
    return std::abs(a.multiplier) > std::abs(b.multiplier);
  };
  for (std::size_t row = 0; row < rows; ++row) {
    const Infeasibility::Row one{static_cast<Index>(row), certificate[row]};
    if (!(std::abs(one.multiplier) > kNegligible * largest)) continue;
    why->rows.insert(std::ranges::upper_bound(why->rows, one, is_larger), one);
    if (why->rows.size() <= Infeasibility::kMostRows) continue;
    why->rows.pop_back();
    ++why->more_rows;
  }
  return why;
}

}  // namespace marble::server
