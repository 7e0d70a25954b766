#include "commands/scenario_files.h"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "file_bytes.h"
#include "npz_problem.h"
#include "output/json.h"

namespace marble::cli {
namespace {

constexpr std::array<const char*, 11> kParts = {"c0", "g", "b", "d", "l", "r", "Q", "A", "C", "L", "R"};

std::optional<ProblemPart> part_of(std::string_view name) {
  for (std::size_t i = 0; i < kParts.size(); ++i)
    if (name == kParts[i]) return static_cast<ProblemPart>(i);
  return std::nullopt;
}

std::vector<Index>* list_of(ScenarioFile& file, std::string_view name) {
  if (name == "first_stage") return &file.first_stage;
  if (name == "own_equalities") return &file.own_equalities;
  if (name == "own_inequalities") return &file.own_inequalities;
  return name == "own_pairs" ? &file.own_pairs : nullptr;
}

Expected<Index> index_of(const std::string& field, double value) {
  constexpr double kMost = std::numeric_limits<Index>::max();
  if (value >= 0.0 && value <= kMost && value == std::floor(value)) return static_cast<Index>(value);
  return unexpected(invalid(field, "must hold whole numbers from 0 on"));
}

Expected<std::vector<Index>> indices_of(const std::string& field, const std::vector<double>& values) {
  std::vector<Index> result;
  for (const double value : values) {
    const auto index = index_of(field, value);
    if (!index) return unexpected(index.error());
    result.push_back(*index);
  }
  return result;
}

// One array of an .npz file: a row for each scenario.
struct Columns {
  std::vector<double> values;
  std::size_t rows = 0, width = 0;
};

Expected<Columns> columns_of(const std::string& name, const formats::NpyArray& array) {
  if (array.shape.empty() || array.shape.size() > 2)
    return unexpected(invalid(name, "must have a row for each scenario"));
  Columns columns{array.values, array.shape[0], array.shape.size() < 2 ? 1 : array.shape[1]};
  if (columns.values.size() != columns.rows * columns.width)
    return unexpected(invalid(name, "must hold numbers"));
  if (array.column_major)
    for (std::size_t k = 0; k < columns.values.size(); ++k)
      columns.values[k] = array.values[k % columns.width * columns.rows + k / columns.width];
  return columns;
}

template <class Value>
Expected<Value> field_of(const nlohmann::json& object, const char* name, Value otherwise) {
  if (!object.contains(name)) return otherwise;
  try {
    return object.at(name).get<Value>();
  } catch (const nlohmann::json::exception&) {
    return unexpected(invalid(name, object.at(name).dump(), "is of the wrong type"));
  }
}

Expected<ScenarioQuantity> quantity_of(const nlohmann::json& object, ScenarioFile& file) {
  ScenarioQuantity quantity;
  const auto word = field_of<std::string>(object, "distribution", "uniform");
  if (!word) return unexpected(word.error());
  if (*word == "normal") {
    quantity.distribution = ScenarioDistribution::normal;
  } else if (*word == "lognormal") {
    quantity.distribution = ScenarioDistribution::lognormal;
  } else if (*word != "uniform") {
    return unexpected(invalid("distribution", *word, "must be uniform, normal or lognormal"));
  }
  for (const auto& [name, into] : {std::pair{"location", &quantity.location},
                                   {"scale", &quantity.scale},
                                   {"least", &quantity.least},
                                   {"most", &quantity.most}}) {
    const auto value = field_of(object, name, *into);
    if (!value) return unexpected(value.error());
    *into = *value;
  }
  const auto effects = field_of(object, "effects", nlohmann::json::array());
  if (!effects || !effects->is_array()) return unexpected(invalid("effects", "must be a list"));
  for (const nlohmann::json& effect : *effects) {
    const auto name = field_of<std::string>(effect, "part", "");
    const auto part = name ? part_of(*name) : std::nullopt;
    if (!part) return unexpected(invalid("part", "must be one of c0, g, b, d, l, r, Q, A, C, L, R"));
    const auto positions = field_of<std::vector<double>>(effect, "positions", {});
    if (!positions) return unexpected(positions.error());
    auto places = indices_of("positions", *positions);
    if (!places) return unexpected(places.error());
    auto gains = field_of<std::vector<double>>(effect, "gains", {1.0});
    if (!gains) return unexpected(gains.error());
    const auto& kept = file.positions.emplace_back(*std::move(places));
    quantity.effects.push_back({{*part, kept}, file.numbers.emplace_back(*std::move(gains))});
  }
  return quantity;
}

}  // namespace

Expected<void> read_samples(const std::string& path, ScenarioFile& file) {
  const auto arrays = formats::read_npz_arrays(path);
  if (!arrays) return unexpected(arrays.error());
  std::vector<Columns> parts;
  for (const auto& [name, array] : *arrays) {
    if (std::vector<Index>* const list = list_of(file, name)) {
      auto indices = indices_of(name, array.values);
      if (!indices) return unexpected(indices.error());
      *list = *std::move(indices);
    } else if (name == "weights") {
      file.table.weights = file.numbers.emplace_back(array.values);
    } else if (const auto part = part_of(name)) {
      auto columns = columns_of(name, array);
      if (!columns) return unexpected(columns.error());
      if (!parts.empty() && columns->rows != parts.front().rows)
        return unexpected(invalid(name, std::to_string(columns->rows) + " rows",
                                  "must have a row for each scenario, as others have"));
      file.table.entries.push_back({*part, {}});
      parts.push_back(*std::move(columns));
    } else {
      return unexpected(invalid(name,
                                "is no array of samples: c0, g, b, d, l, r, Q, A, C, L, R, weights, "
                                "first_stage, own_equalities, own_inequalities or own_pairs"));
    }
  }
  std::vector<double>& values = file.numbers.emplace_back();
  for (std::size_t i = 0; !parts.empty() && i < parts.front().rows; ++i)
    for (const Columns& part : parts) {
      const auto row = part.values.begin() + static_cast<std::ptrdiff_t>(i * part.width);
      values.insert(values.end(), row, row + static_cast<std::ptrdiff_t>(part.width));
    }
  file.table.values = values;
  return {};
}

Expected<void> read_sampler(const std::string& path, ScenarioFile& file) {
  const auto bytes = formats::read_bytes(path);
  if (!bytes) return unexpected(bytes.error());
  const nlohmann::json content = parsed<nlohmann::json>(*bytes);
  if (!content.is_object())
    return unexpected(
        invalid("", "must be a JSON object, nested at most " + std::to_string(kDeepestJson) + " deep"));
  for (const char* const name : {"first_stage", "own_equalities", "own_inequalities", "own_pairs"}) {
    const auto values = field_of<std::vector<double>>(content, name, {});
    if (!values) return unexpected(values.error());
    auto indices = indices_of(name, *values);
    if (!indices) return unexpected(indices.error());
    *list_of(file, name) = *std::move(indices);
  }
  const auto seed = field_of<std::uint64_t>(content, "seed", 0);
  if (!seed) return unexpected(seed.error());
  file.sampler.seed = *seed;
  const auto quantities = field_of(content, "quantities", nlohmann::json::array());
  if (!quantities || !quantities->is_array()) return unexpected(invalid("quantities", "must be a list"));
  for (std::size_t q = 0; q < quantities->size(); ++q) {
    auto quantity = quantity_of(quantities->at(q), file);
    if (!quantity) return unexpected(inside("quantities[" + std::to_string(q) + "]", quantity.error()));
    file.sampler.quantities.push_back(*std::move(quantity));
  }
  return {};
}

Expected<std::vector<Index>> parse_indices(const std::string& text) {
  std::vector<Index> result;
  const auto refuse = [&] {
    return unexpected(invalid("--first-stage", text, "must be numbers and ranges such as 0-3,7"));
  };
  const auto number = [](std::string_view word) -> std::optional<Index> {
    Index value = 0;
    const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (fault != std::errc() || end != word.data() + word.size() || value < 0) return std::nullopt;
    return value;
  };
  constexpr Index kLongestRange = 1 << 28;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    const std::string_view word = std::string_view(text).substr(at, comma - at);
    const std::size_t dash = word.find('-');
    const auto first = number(word.substr(0, dash));
    const auto last = dash == std::string_view::npos ? first : number(word.substr(dash + 1));
    if (!first || !last || *last < *first || *last - *first > kLongestRange) return refuse();
    for (Index i = *first; i <= *last; ++i) result.push_back(i);
    at = comma + 1;
  }
  return result;
}

}  // namespace marble::cli
