#include "solver/batch_order.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "model/tuning.h"
#include "path/noise.h"

namespace marble {
namespace {

// A number of the elements that differs between them: over its largest size, to avoid overflow, it has this
// mean and this deviation.
struct Column {
  const double* values;
  std::size_t stride;
  double size, mean, deviation;
};

std::vector<Column> differing(std::size_t count, std::span<const BatchPart> parts) {
  std::vector<Column> columns;
  for (const BatchPart& part : parts) {
    if (part.values.empty()) continue;
    std::vector<double> size(part.size, 0.0), mean(part.size, 0.0), square(part.size, 0.0);
    const auto each = [&](const auto& visit) {
      for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = 0; j < part.size; ++j) visit(j, part.values[i * part.size + j]);
    };
    const double each_weight = 1.0 / static_cast<double>(count);
    each([&](std::size_t j, double value) { size[j] = std::max(size[j], std::abs(value)); });
    for (double& entry : size) entry = entry > 0.0 ? entry : 1.0;
    each([&](std::size_t j, double value) { mean[j] += value / size[j] * each_weight; });
    each([&](std::size_t j, double value) {
      const double apart = value / size[j] - mean[j];
      square[j] += apart * apart * each_weight;
    });
    for (std::size_t j = 0; j < part.size; ++j) {
      const double deviation = std::sqrt(square[j]);
      if (deviation > tuning::rounding)
        columns.push_back({part.values.data() + j, part.size, size[j], mean[j], deviation});
    }
  }
  return columns;
}

}  // namespace

inline double BatchOrder::distance(std::size_t a, std::size_t b) const {
  const double* const first = points_.data() + a * dimensions_;
  const double* const second = points_.data() + b * dimensions_;
  double sum = 0.0;
  for (std::size_t k = 0; k < dimensions_; ++k) sum += (first[k] - second[k]) * (first[k] - second[k]);
  return sum;
}

BatchOrder::BatchOrder(std::size_t count, std::span<const BatchPart> parts) : order_(count) {
  const std::vector<Column> columns = differing(count, parts);
  const bool projects = columns.size() > tuning::batch_dimensions;
  dimensions_ = std::min(columns.size(), tuning::batch_dimensions);
  points_.assign(count * dimensions_, 0.0);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const Column& column = columns[c];
    for (std::size_t k = 0; k < dimensions_; ++k) {
      if (!projects && k != c) continue;
      const double weight = (projects ? signed_noise(c, k) : 1.0) / column.deviation;
      for (std::size_t i = 0; i < count; ++i)
        points_[i * dimensions_ + k] +=
            weight * (column.values[i * column.stride] / column.size - column.mean);
    }
  }
  kept_ = std::min(count, tuning::batch_kept);
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::vector<double> apart(count, std::numeric_limits<double>::infinity());
  for (std::size_t position = 1; position < kept_; ++position) {
    std::size_t farthest = position;
    for (std::size_t other = position; other < count; ++other) {
      double& least = apart[order_[other]];
      least = std::min(least, distance(order_[other], order_[position - 1]));
      const double most = apart[order_[farthest]];
      if (least > most || (least == most && order_[other] < order_[farthest])) farthest = other;
    }
    std::swap(order_[position], order_[farthest]);
  }
  std::sort(order_.begin() + static_cast<std::ptrdiff_t>(kept_), order_.end());
}

void BatchOrder::find_nearest(std::size_t element, std::span<const std::uint8_t> usable, std::size_t most,
                              std::vector<std::size_t>& nearest) const {
  nearest.clear();
  std::vector<double> distances;
  distances.reserve(most + 1);
  for (std::size_t position = 0; position < usable.size(); ++position) {
    if (usable[position] == 0) continue;
    const double at = distance(element, order_[position]);
    if (nearest.size() == most) {
      if (at >= distances.back()) continue;
      nearest.pop_back();
      distances.pop_back();
    }
    const auto place = std::upper_bound(distances.begin(), distances.end(), at);
    nearest.insert(nearest.begin() + (place - distances.begin()), position);
    distances.insert(place, at);
  }
}

}  // namespace marble
