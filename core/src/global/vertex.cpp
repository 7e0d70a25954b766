#include "global/vertex.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "global/linear_rows.h"
#include "model/tuning.h"

namespace marble {

// Sorts columns by decreasing multipliers: the large ones become the basis, where rounding does least harm.
bool VertexTableau::fill(std::span<const HeldRow> held, std::span<const double> multipliers) {
  places_.clear();
  std::vector<double> size(held.size());
  std::vector<Index> line_of(static_cast<std::size_t>(rows_.columns), -1);
  Index lines = 0;
  for (std::size_t k = 0; k < held.size(); ++k) {
    if (multipliers[k] == 0.0) continue;
    const Index row = held[k].row;
    size[k] = std::abs(offset_[row]);
    for (Index e = rows_.row_pointers[row]; e < rows_.row_pointers[row + 1]; ++e) {
      size[k] = std::max(size[k], std::abs(rows_.values[e]));
      Index& line = line_of[static_cast<std::size_t>(rows_.column_indices[e])];
      if (line < 0) line = lines++;
    }
    if (size[k] > 0.0) places_.push_back(k);
  }
  const double entries = (lines + 1.0) * static_cast<double>(places_.size());
  if (places_.empty() || entries > tuning::conflict_entries) return false;
  std::ranges::stable_sort(places_, [&](std::size_t a, std::size_t b) {
    return std::abs(multipliers[a]) * size[a] > std::abs(multipliers[b]) * size[b];
  });
  const auto count = static_cast<Eigen::Index>(places_.size());
  tableau_.setZero(lines + 1, count);
  multiplier_.resize(count);
  for (Eigen::Index c = 0; c < count; ++c) {
    const std::size_t k = places_[static_cast<std::size_t>(c)];
    const Index row = held[k].row;
    multiplier_[c] = multipliers[k] * size[k];
    for (Index e = rows_.row_pointers[row]; e < rows_.row_pointers[row + 1]; ++e)
      tableau_(line_of[static_cast<std::size_t>(rows_.column_indices[e])], c) += rows_.values[e] / size[k];
    tableau_(lines, c) = offset_[row] / size[k];
  }
  basis_.assign(static_cast<std::size_t>(lines) + 1, -1);
  return true;
}

void VertexTableau::pivot(Eigen::Index line, Eigen::Index column) {
  tableau_.row(line) /= tableau_(line, column);
  const Eigen::VectorXd factors = tableau_.col(column);
  for (Eigen::Index other = 0; other < tableau_.rows(); ++other) {
    if (other != line && factors[other] != 0.0) tableau_.row(other) -= factors[other] * tableau_.row(line);
  }
  basis_[static_cast<std::size_t>(line)] = column;
}

// Adds a column to the basis if the basis does not span it. Otherwise it equals Σ t of the basis, and the
// multipliers move along this dependency until the column's own or one of the basis is 0.
void VertexTableau::enter(Eigen::Index column, std::span<const HeldRow> held) {
  const auto lines = static_cast<Eigen::Index>(basis_.size());
  Eigen::Index best = -1;
  for (Eigen::Index line = 0; line < lines; ++line) {
    if (basis_[static_cast<std::size_t>(line)] >= 0) continue;
    if (best < 0 || std::abs(tableau_(line, column)) > std::abs(tableau_(best, column))) best = line;
  }
  if (best >= 0 && std::abs(tableau_(best, column)) > tuning::exactness) return pivot(best, column);
  const double sign = multiplier_[column] > 0.0 ? 1.0 : -1.0;
  double step = std::abs(multiplier_[column]);
  Eigen::Index leaving = -1;
  for (Eigen::Index line = 0; line < lines; ++line) {
    const Eigen::Index of = basis_[static_cast<std::size_t>(line)];
    if (of < 0 || held[places_[static_cast<std::size_t>(of)]].equality) continue;
    const double rate = sign * tableau_(line, column);  // of a multiplier that must stay ≤ 0
    if (rate <= tuning::exactness || -multiplier_[of] >= step * rate) continue;
    step = std::max(0.0, -multiplier_[of] / rate);
    leaving = line;
  }
  for (Eigen::Index line = 0; line < lines; ++line) {
    const Eigen::Index of = basis_[static_cast<std::size_t>(line)];
    if (of >= 0) multiplier_[of] += step * sign * tableau_(line, column);
  }
  if (leaving < 0) {
    multiplier_[column] = 0.0;
    return;
  }
  multiplier_[column] -= step * sign;
  multiplier_[basis_[static_cast<std::size_t>(leaving)]] = 0.0;
  pivot(leaving, column);
}

std::vector<std::size_t> VertexTableau::support(std::span<const HeldRow> held,
                                                std::span<const double> multipliers) {
  if (!fill(held, multipliers)) return {};
  for (Eigen::Index column = 0; column < tableau_.cols(); ++column) enter(column, held);
  const double largest = max_abs(multiplier_);
  std::vector<std::size_t> left;
  for (const Eigen::Index column : basis_) {
    if (column >= 0 && std::abs(multiplier_[column]) > tuning::exactness * largest)
      left.push_back(places_[static_cast<std::size_t>(column)]);
  }
  std::ranges::sort(left);
  return left;
}

}  // namespace marble
