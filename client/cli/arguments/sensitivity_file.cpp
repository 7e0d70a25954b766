#include "arguments/sensitivity_file.h"

#include <fstream>
#include <iterator>
#include <string_view>
#include <utility>

namespace marble::cli {
namespace {

using Numbers = std::vector<double>;

// The destination of one part's numbers, and their count per direction or loss.
struct Place {
  std::string_view name;
  Numbers* all;
  std::size_t size;
};

Expected<Numbers> take_numbers(const Json& json, const std::string& field, std::size_t size) {
  if (!json.is_array()) return unexpected(invalid(field, "must be a list of numbers"));
  if (json.size() != size) {
    return unexpected(invalid(field, std::to_string(json.size()) + " entries",
                              "must have " + std::to_string(size) + " entries"));
  }
  Numbers numbers;
  for (const Json& number : json) {
    if (!number.is_number()) {
      return unexpected(
          invalid(field, static_cast<std::int64_t>(numbers.size()), number.dump(), "must be a number"));
    }
    numbers.push_back(number.get<double>());
  }
  return numbers;
}

// Reads a list of directions or losses: for each its parts, one after the other, with zeros for the others.
Expected<Index> take_list(const Json& json, const std::string& field, std::span<const Place> places) {
  if (!json.contains(field)) return 0;
  const Json& list = json[field];
  if (!list.is_array()) return unexpected(invalid(field, "must be a list of objects"));
  for (std::size_t k = 0; k < list.size(); ++k) {
    const std::string at = field + "[" + std::to_string(k) + "]";
    if (!list[k].is_object()) return unexpected(invalid(at, "must be an object of lists of numbers"));
    for (const auto& [name, values] : list[k].items()) {
      const auto place = std::ranges::find(places, name, &Place::name);
      if (place == places.end()) return unexpected(invalid(at + "." + name, "is no part of it"));
      auto numbers = take_numbers(values, at + "." + name, place->size);
      if (!numbers) return unexpected(numbers.error());
      place->all->resize(list.size() * place->size);
      std::ranges::copy(*numbers, place->all->begin() + static_cast<std::ptrdiff_t>(k * place->size));
    }
  }
  return static_cast<Index>(list.size());
}

Expected<SparseMatrix> take_rows(const Json& json, std::size_t variables) {
  if (!json.is_array() || json.empty())
    return unexpected(invalid("rows.E", "must be a list of rows of numbers"));
  Triplets entries;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const auto row = take_numbers(json[i], "rows.E[" + std::to_string(i) + "]", variables);
    if (!row) return unexpected(row.error());
    for (std::size_t j = 0; j < row->size(); ++j) {
      if ((*row)[j] != 0.0) entries.add(static_cast<Index>(i), static_cast<Index>(j), (*row)[j]);
    }
  }
  return compress(static_cast<Index>(json.size()), static_cast<Index>(variables), entries, "rows.E");
}

Expected<void> take(const Json& json, const OwnedProblem& problem, OwnedSensitivityRequest& request) {
  if (!json.is_object()) return unexpected(invalid("", "must be an object"));
  for (const auto& [name, part] : json.items()) {
    if (name != "directions" && name != "losses" && name != "rows")
      return unexpected(invalid(name, "must be directions, losses or rows"));
  }
  std::vector<Place> places;
#define MARBLE_VECTOR(letter, field) \
  places.push_back({#letter, &request.numbers.letter, problem.letter.size()});
#define MARBLE_MATRIX(letter, field, update, vector) \
  places.push_back({#letter, &request.numbers.letter.values, problem.letter.values.size()});
#include "marble/contract.def"
  const auto directions = take_list(json, "directions", places);
  if (!directions) return unexpected(directions.error());
  request.directions = *directions;
  const Place of_answer[] = {
      {"z", &request.z, problem.g.size()},
      {"equality_multipliers", &request.equality_multipliers, problem.b.size()},
      {"inequality_multipliers", &request.inequality_multipliers, problem.d.size()},
      {"complementarity_multipliers_L", &request.complementarity_multipliers_L, problem.l.size()},
      {"complementarity_multipliers_R", &request.complementarity_multipliers_R, problem.r.size()}};
  const auto losses = take_list(json, "losses", of_answer);
  if (!losses) return unexpected(losses.error());
  request.losses = *losses;
  if (!json.contains("rows")) return {};
  const Json& rows = json["rows"];
  if (!rows.is_object()) return unexpected(invalid("rows", "must be an object with E"));
  auto E = take_rows(rows.value("E", Json()), problem.g.size());
  if (!E) return unexpected(E.error());
  request.E = std::move(*E);
  for (const auto& [name, part] : rows.items()) {
    Numbers* const vector = name == "proximal" ? &request.proximal : name == "g" ? &request.g : nullptr;
    if (vector != nullptr) {
      auto numbers = take_numbers(part, "rows." + name, problem.g.size());
      if (!numbers) return unexpected(numbers.error());
      *vector = std::move(*numbers);
    } else if (name == "columns" && part.is_boolean()) {
      request.columns = part.get<bool>();
    } else if (name != "E") {
      return unexpected(invalid("rows." + name, "must be E, proximal, g or columns, which is true or false"));
    }
  }
  return {};
}

}  // namespace

Expected<Json> read_sensitivity(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return unexpected(
        failure(ErrorCode::not_found, "--sensitivity", path, "must be a file that can be read"));
  const std::string text(std::istreambuf_iterator<char>(file), {});
  Json json = parsed(text);
  if (json.is_discarded())
    return unexpected(
        invalid("--sensitivity", path,
                "must be a file of JSON, nested at most " + std::to_string(kDeepestJson) + " deep"));
  return json;
}

Expected<OwnedSensitivityRequest> sensitivity_of(const Json& json, const OwnedProblem& problem) {
  OwnedSensitivityRequest request;
  if (auto taken = take(json, problem, request); !taken) {
    Error error = taken.error();
    error.field = error.field.empty() ? "sensitivity" : "sensitivity." + error.field;
    return unexpected(std::move(error));
  }
  return request;
}

}  // namespace marble::cli
