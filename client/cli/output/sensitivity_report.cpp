#include "output/sensitivity_report.h"

#include <algorithm>
#include <span>

namespace marble::cli {
namespace {

std::span<const double> share(std::span<const double> all, std::size_t number, std::size_t count) {
  const std::size_t size = all.size() / count;
  return all.subspan(number * size, size);
}

Json changes_json(const AnswerChanges& changes) {
  Json list = Json::array();
  const std::size_t count = changes.active_set_constant.size();
  for (std::size_t k = 0; k < count; ++k) {
    if (std::ranges::count(changes.undefined, static_cast<Index>(k)) > 0) {
      list.push_back(nullptr);
      continue;
    }
    list.push_back({{"z", share(changes.z, k, count)},
                    {"equality_multipliers", share(changes.equality_multipliers, k, count)},
                    {"inequality_multipliers", share(changes.inequality_multipliers, k, count)},
                    {"complementarity_multipliers_L", share(changes.complementarity_multipliers_L, k, count)},
                    {"complementarity_multipliers_R", share(changes.complementarity_multipliers_R, k, count)},
                    {"active_set_constant", changes.active_set_constant[k] != 0}});
  }
  return list;
}

Json gradients_json(const ProblemGradients& gradients, std::size_t variables) {
  Json list = Json::array();
  const std::size_t count = gradients.g.size() / variables;
  for (std::size_t k = 0; k < count; ++k) {
    Json gradient;
#define MARBLE_VECTOR(letter, field) gradient[#letter] = share(gradients.letter, k, count);
#define MARBLE_MATRIX(letter, field, update, vector) gradient[#letter] = share(gradients.letter, k, count);
#include "marble/contract.def"
    const bool missing = std::ranges::count(gradients.undefined, static_cast<Index>(k)) > 0;
    list.push_back(missing ? Json(nullptr) : gradient);
  }
  return list;
}

Json rows_json(const RowResponse& rows) {
  const std::size_t m = rows.values.size(), n = rows.z.size();
  Json response = Json::array(), columns = Json::array();
  for (std::size_t i = 0; i < m; ++i) {
    Json row = Json::array();
    for (std::size_t j = 0; j < m; ++j) {
      const auto [low, high] = std::minmax(i, j);
      row.push_back(rows.response[low + high * (high + 1) / 2]);
    }
    response.push_back(row);
    if (n > 0) columns.push_back(std::span(rows.columns).subspan(i * n, n));
  }
  Json json{{"values", rows.values}, {"free", rows.free}, {"response", response}};
  if (n > 0) json["z"] = rows.z, json["columns"] = columns;
  return json;
}

std::string counted(std::size_t count, const char* one, const char* many) {
  return std::to_string(count) + " " + (count == 1 ? one : many);
}

}  // namespace

std::string sensitivity_text(const Solution& answer) {
  if (!answer.sensitivity) return "";
  if (!*answer.sensitivity) return "none: " + answer.sensitivity->error().message();
  const SensitivityAnswer& reported = **answer.sensitivity;
  const std::size_t changes = reported.changes.active_set_constant.size(),
                    losses = reported.gradients.g.size() / answer.z.size();
  std::string text = counted(changes, "direction", "directions");
  if (!reported.is_smooth())
    text += " (" + std::to_string(std::ranges::count(reported.changes.active_set_constant, 1)) +
            " with a constant active set)";
  text += ", " + counted(losses, "loss", "losses");
  if (reported.rows)
    text += *reported.rows ? ", " + counted((*reported.rows)->values.size(), "row", "rows") : ", no rows";
  if (const std::size_t missing = reported.changes.undefined.size() + reported.gradients.undefined.size();
      missing > 0)
    text += ", " + std::to_string(missing) + " without derivatives";
  if (!reported.is_smooth()) {
    text += "; one-sided: " + counted(reported.biactive_pairs.size(), "biactive pair", "biactive pairs") +
            ", " + counted(reported.weak_inequalities.size(), "weak inequality", "weak inequalities");
  }
  return text;
}

Json sensitivity_json(const Solution& answer) {
  if (!answer.sensitivity) return nullptr;
  if (!*answer.sensitivity) return {{"error", to_json(answer.sensitivity->error())}};
  const SensitivityAnswer& reported = **answer.sensitivity;
  Json json{{"smooth", reported.is_smooth()},
            {"weak_inequalities", reported.weak_inequalities},
            {"biactive_pairs", reported.biactive_pairs},
            {"changes", changes_json(reported.changes)},
            {"gradients", gradients_json(reported.gradients, answer.z.size())}};
  if (reported.rows)
    json["rows"] =
        *reported.rows ? rows_json(**reported.rows) : Json{{"error", to_json(reported.rows->error())}};
  json["factorizations"] = reported.factorizations;
  json["back_substitutions"] = reported.back_substitutions;
  return json;
}

}  // namespace marble::cli
