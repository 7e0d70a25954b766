// Checks and copies of linear complementarity systems.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "lcs/check.h"
#include "marble/lcs.h"
#include "model/text_of.h"

namespace marble {
namespace {

struct Shape {
  const char* name;
  std::span<const double> LcsView::*values;
  Index LcsView::*rows;
  Index LcsView::*columns;  // nullptr of a vector
};

constexpr std::array<Shape, lcs_part_count> kShapes = {{
    {"A", &LcsView::A, &LcsView::states, &LcsView::states},
    {"B", &LcsView::B, &LcsView::states, &LcsView::inputs},
    {"D", &LcsView::D, &LcsView::states, &LcsView::pairs},
    {"d", &LcsView::d, &LcsView::states, nullptr},
    {"E", &LcsView::E, &LcsView::pairs, &LcsView::states},
    {"F", &LcsView::F, &LcsView::pairs, &LcsView::pairs},
    {"H", &LcsView::H, &LcsView::pairs, &LcsView::inputs},
    {"c", &LcsView::c, &LcsView::pairs, nullptr},
}};

std::size_t entries_of(const Shape& shape, const LcsView& view) {
  const auto rows = static_cast<std::size_t>(view.*shape.rows);
  return shape.columns == nullptr ? rows : rows * static_cast<std::size_t>(view.*shape.columns);
}

Expected<void> check_sizes(const LcsView& view) {
  static const auto kLargest = static_cast<Index>(std::sqrt(std::numeric_limits<Index>::max()));
  const auto check = [](const char* field, Index value, Index least) -> Expected<void> {
    if (value >= least && value <= kLargest) return {};
    return unexpected(invalid(field, std::to_string(value),
                              "must be in [" + std::to_string(least) + ", " + std::to_string(kLargest) +
                                  "], so that an Index counts the entries of a block"));
  };
  auto valid = check("states", view.states, 1);
  if (valid) valid = check("inputs", view.inputs, 1);
  if (valid) valid = check("pairs", view.pairs, 0);
  return valid;
}

}  // namespace

Expected<LCS> LCS::create(const LcsView& view) {
  MARBLE_RETURN_IF_ERROR(check_sizes(view));
  LCS made;
  std::size_t stages = 0;
  for (std::size_t k = 0; k < lcs_part_count; ++k) {
    const Shape& shape = kShapes[k];
    const std::span<const double> values = view.*shape.values;
    const std::size_t entries = entries_of(shape, view);
    const bool is_constant = values.size() == entries;
    if (!is_constant && (entries == 0 || values.empty() || values.size() % entries != 0)) {
      return unexpected(invalid(shape.name, std::to_string(values.size()),
                                "must have " + std::to_string(entries) + " entries, or so many per stage"));
    }
    if (!is_constant) {
      made.strides_[k] = entries;
      const std::size_t count = values.size() / entries;
      if (stages != 0 && stages != count) {
        return unexpected(invalid(
            shape.name, std::to_string(count),
            "stages; must have " + std::to_string(stages) + " stages, as many as the parts before it"));
      }
      stages = count;
    }
    MARBLE_RETURN_IF_ERROR(check_stages(values, entries, shape.name));
    made.parts_[k].assign(values.begin(), values.end());
  }
  made.states_ = view.states, made.inputs_ = view.inputs, made.pairs_ = view.pairs;
  made.stages_ = static_cast<Index>(stages);
  return made;
}

std::span<const double> LCS::part(LcsPart part, Index stage) const {
  const auto k = static_cast<std::size_t>(part);
  const std::vector<double>& values = parts_[k];
  if (strides_[k] == 0) return values;
  return std::span(values).subspan(static_cast<std::size_t>(stage) * strides_[k], strides_[k]);
}

Expected<void> check_stages(std::span<const double> values, std::size_t entries, const std::string& field) {
  const auto bad = std::ranges::find_if_not(values, [](double value) { return std::isfinite(value); });
  if (bad == values.end()) return {};
  const auto at = static_cast<std::size_t>(bad - values.begin());
  const std::string place =
      values.size() > entries ? field + "[" + std::to_string(at / entries) + "]" : field;
  return unexpected(invalid(place, static_cast<std::int64_t>(at % entries), text_of(*bad), "must be finite"));
}

}  // namespace marble
