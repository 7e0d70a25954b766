#include "marble/json_problem.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "json_reader.h"

namespace marble {
namespace {

using json::JsonMatrix, json::JsonParts;

Expected<void> check_entries(const std::vector<double>& values, const char* key, Index size) {
  if (values.size() == static_cast<std::size_t>(size)) return {};
  return unexpected(invalid(key, std::to_string(values.size()) + " entries",
                            "must have " + std::to_string(size) + " entries (n)"));
}

// Compares sizes before it allocates anything of that size.
Expected<SparseMatrix> take_matrix(const JsonMatrix& part, const std::string& key, std::size_t rows,
                                   const char* rows_rule, Index n) {
  if (!part.present) return SparseMatrix{};
  const std::pair<bool, const char*> members[] = {{part.rows.has_value(), ".rows"},
                                                  {part.columns.has_value(), ".cols"},
                                                  {part.has_i, ".i"},
                                                  {part.has_j, ".j"},
                                                  {part.has_v, ".v"}};
  for (const auto& [present, member] : members) {
    if (!present) return unexpected(invalid(key + member, "is missing"));
  }
  if (static_cast<std::size_t>(*part.rows) != rows) {
    return unexpected(invalid(key + ".rows", std::to_string(*part.rows),
                              "must be " + std::to_string(rows) + " (" + rows_rule + ")"));
  }
  if (*part.columns != n) {
    return unexpected(
        invalid(key + ".cols", std::to_string(*part.columns), "must be " + std::to_string(n) + " (n)"));
  }
  return compress(*part.rows, *part.columns, part.entries, key.c_str());
}

// Converts an error of Problem::create to the file's position of the entry: positions in compressed columns
// mean nothing to users of the file.
Error in_terms_of_file(Error error, const JsonParts& parts, const OwnedProblem& problem) {
  const struct {
    std::string name;
    const JsonMatrix& part;
    const SparseMatrix& matrix;
  } matrices[] = {
#define MARBLE_MATRIX(letter, field, update, vector) {#letter, parts.letter, problem.letter},
#include "marble/contract.def"
  };
  for (const auto& [name, part, matrix] : matrices) {
    if (error.field == name + ".columns") error.field = name + ".cols";
    if (error.field != name + ".values" || error.index < 0) continue;
    error.field = name + ".v";
    const auto& starts = matrix.column_pointers;
    const auto next = std::upper_bound(starts.begin(), starts.end(), static_cast<Index>(error.index));
    const auto column = static_cast<Index>(next - starts.begin()) - 1;
    const Index row = matrix.row_indices[static_cast<std::size_t>(error.index)];
    for (std::size_t k = 0; k < part.entries.values.size(); ++k) {
      if (part.entries.rows[k] != row || part.entries.columns[k] != column) continue;
      error.index = static_cast<std::int64_t>(k);
      break;
    }
  }
  return error;
}

using OrderedJson = nlohmann::ordered_json;

OrderedJson triplets(const SparseMatrix& m, std::size_t rows, std::size_t columns, bool mirror) {
  std::vector<Index> i, j;
  std::vector<double> v;
  const auto add = [&](Index row, Index column, double value) {
    i.push_back(row);
    j.push_back(column);
    v.push_back(value);
  };
  for (Index column = 0; column < m.columns && !m.values.empty(); ++column) {
    for (Index k = m.column_pointers[column]; k < m.column_pointers[column + 1]; ++k) {
      add(m.row_indices[k], column, m.values[k]);
      if (mirror && m.row_indices[k] != column) add(column, m.row_indices[k], m.values[k]);
    }
  }
  return {{"rows", rows}, {"cols", columns}, {"i", i}, {"j", j}, {"v", v}};
}

Expected<JsonProblem> problem_of(JsonParts parts, const std::string& name) {
  if (!parts.n) return unexpected(invalid("n", "is missing"));
  if (!parts.g.present) return unexpected(invalid("g", "is missing"));
  JsonProblem file;
  file.best_known_objective = parts.best_known_objective;
  OwnedProblem& p = file.problem;
  p.name = parts.name.empty() ? name : parts.name;
  p.c0 = parts.c0.value_or(0.0);

  const Index n = *parts.n;
#define MARBLE_VECTOR(letter, field) p.letter = std::move(parts.letter.values);
#include "marble/contract.def"
  p.initial_z = std::move(parts.x0.values);
  MARBLE_RETURN_IF_ERROR(check_entries(p.g, "g", n));
  if (parts.x0.present) {
    MARBLE_RETURN_IF_ERROR(check_entries(p.initial_z, "x0", n));
  }
  if (p.r.size() != p.l.size()) {
    return unexpected(invalid("r", std::to_string(p.r.size()) + " entries",
                              "must have " + std::to_string(p.l.size()) + " entries, as many as l"));
  }
  const struct {
    const char* key;
    const JsonMatrix& part;
    std::size_t rows;
    const char* rows_rule;
    SparseMatrix& into;
  } matrices[] = {
#define MARBLE_MATRIX(letter, field, update, vector) \
  {#letter, parts.letter, p.vector.size(), "entries of " #vector, p.letter},
#include "marble/contract.def"
  };
  for (const auto& [key, part, rows, rows_rule, into] : matrices) {
    MARBLE_ASSIGN_OR_RETURN(into, take_matrix(part, key, rows, &into == &p.Q ? "n" : rows_rule, n));
  }
  if (const auto valid = Problem::create(p.view()); !valid) {
    return unexpected(in_terms_of_file(valid.error(), parts, p));
  }
  return file;
}

}  // namespace

Expected<JsonProblem> parse_json(std::string_view text, const std::string& name) {
  MARBLE_ASSIGN_OR_RETURN(auto parts, json::read_json_parts(text));
  return problem_of(std::move(parts), name);
}

Expected<JsonRequest> parse_json_request(std::string_view text, std::span<const std::string_view> members) {
  MARBLE_ASSIGN_OR_RETURN(auto read, json::read_json_request(text, members));
  if (!read.problem) return JsonRequest{std::nullopt, std::move(read.rest)};
  auto problem = problem_of(std::move(*read.problem), "");
  if (!problem) return unexpected(read.bare ? problem.error() : inside("problem", problem.error()));
  return JsonRequest{std::move(*problem), std::move(read.rest)};
}

std::string write_json(const OwnedProblem& p, std::optional<double> best_known_objective) {
  const std::size_t n = p.g.size();
  OrderedJson json;
  json["name"] = p.name;
  if (best_known_objective) json["best_known_objective"] = *best_known_objective;
  json["n"] = n;
  json["c0"] = p.c0;
  const bool upper = p.hessian_form == HessianForm::upper_triangle;
#define MARBLE_VECTOR(letter, field) json[#letter] = p.letter;
#define MARBLE_MATRIX(letter, field, update, vector) \
  json[#letter] = triplets(p.letter, p.vector.size(), n, upper && &p.letter == &p.Q);
#include "marble/contract.def"
  json["x0"] = p.initial_z.empty() ? OrderedJson(nullptr) : OrderedJson(p.initial_z);
  return json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

}  // namespace marble
