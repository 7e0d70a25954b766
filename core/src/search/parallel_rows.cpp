#include "search/parallel_rows.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "model/text_of.h"
#include "model/tuning.h"
#include "path/noise.h"

namespace marble {
namespace {

// Sparse rows of norm 1, with signs such that their projection is not negative.
class UnitRows {
 public:
  explicit UnitRows(const ScaledProblem& problem)
      : rows_(problem), dense_(Vector::Zero(problem.variables())) {
    Vector direction(problem.variables());
    for (Index j = 0; j < problem.variables(); ++j)
      direction[j] = signed_noise(0, static_cast<std::uint64_t>(j));
    projections_.reserve(static_cast<std::size_t>(rows_.size()));
    scale_.resize(rows_.size());
    for (Index row = 0; row < rows_.size(); ++row) {
      double square = 0.0, projection = 0.0;
      rows_.for_each_entry(row, [&](Index column, double value) {
        square += value * value;
        projection += value * direction[column];
      });
      if (!(square > 0.0)) continue;
      scale_[row] = std::copysign(1.0 / std::sqrt(square), projection);
      projections_.emplace_back(projection * scale_[row], row);
    }
    std::sort(projections_.begin(), projections_.end());
  }

  [[nodiscard]] const std::vector<std::pair<double, Index>>& projections() const { return projections_; }

  // Returns the sine of the angle between two rows.
  [[nodiscard]] double sine(Index first, Index second) {
    const auto add = [&](Index row, double factor) {
      rows_.for_each_entry(row, [&](Index column, double value) { dense_[column] += factor * value; });
    };
    double square = 0.0;
    add(first, scale_[first]);
    add(second, -scale_[second]);
    for (const Index row : {first, second})
      rows_.for_each_entry(row, [&](Index column, double) {
        square += dense_[column] * dense_[column];
        dense_[column] = 0.0;
      });
    return std::sqrt(square);
  }

 private:
  RowAccess rows_;
  Vector dense_, scale_;
  std::vector<std::pair<double, Index>> projections_;
};

std::string name(const ScaledProblem& p, Index row) {
  const RowLayout& rows = p.layout;
  const auto entry = [](const char* matrix, Index at) { return matrix + ("[" + std::to_string(at) + "]"); };
  if (row < p.equalities()) return entry("A", row);
  row -= p.equalities();
  if (row < rows.s(0)) return entry("C", row);
  return row < rows.t(0) ? entry("L", row - rows.s(0)) : entry("R", row - rows.t(0));
}

}  // namespace

std::optional<ParallelRows> nearly_parallel_rows(const ScaledProblem& problem) {
  UnitRows rows(problem);
  const auto& projections = rows.projections();
  std::optional<ParallelRows> result;
  double least = tuning::parallel_rows;
  for (std::size_t i = 0; i < projections.size(); ++i) {
    const std::size_t last = std::min(projections.size(), i + 1 + tuning::parallel_neighbours);
    for (std::size_t k = i + 1; k < last; ++k) {
      if (projections[k].first - projections[i].first > tuning::parallel_rows) break;
      const auto [first, second] = std::minmax(projections[i].second, projections[k].second);
      const double sine = rows.sine(first, second);
      if (!(sine > tuning::rounding) || sine >= least) continue;
      least = sine;
      result = ParallelRows{first, second, sine};
    }
  }
  return result;
}

std::string describe(const ScaledProblem& problem, const ParallelRows& rows) {
  return "ill-conditioned rows " + name(problem, rows.first) + " and " + name(problem, rows.second) +
         ": parallel to within " + scientific(rows.sine, 0);
}

}  // namespace marble
