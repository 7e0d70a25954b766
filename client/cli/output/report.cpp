#include "output/report.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "marble/report/solution_kind.h"
#include "marble/solution.h"
#include "output/json.h"
#include "output/proof.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

// Reports a solution's derivatives, for people and for programs.

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

// Returns a one-line summary of a solution's derivatives; empty if none were requested.
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

// Returns all derivatives as an object; null if none were requested.
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

__attribute__((format(printf, 1, 2))) std::string format(const char* pattern, ...) {
  char text[256];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

// Returns a detail's part by its number, from 0; empty beyond the last.
std::string part_of(const std::string& detail, int number) {
  std::size_t begin = 0;
  for (; number > 0; --number) {
    const std::size_t end = detail.find("; ", begin);
    if (end == std::string::npos) return "";
    begin = end + 2;
  }
  return detail.substr(begin, detail.find("; ", begin) - begin);
}

// With global search a detail begins with the tree's result, if only why there was none. For a small
// problem's tree it comes last: the solution is the local one, unless the tree has found a better one.
bool begins_with_proof(const Answer& s) {
  return s.detail.starts_with("proved by ") || s.detail.starts_with("not proved");
}

std::string speed_text(const Answer& s) {
  constexpr std::int64_t kEnoughToReport = 100;
  if (s.nodes < kEnoughToReport || !(s.times.solve_s > 0.0)) return "";
  return format(", %.0f nodes a second", static_cast<double>(s.nodes) / s.times.solve_s);
}

std::string proof_line(const Subject& p, const Answer& s) {
  if (s.nodes > 0 && begins_with_proof(s)) {
    Proof proof = proof_of(s);
    proof.bound = p.of_file(proof.bound);
    return "  proof           " + proof_text(proof) + speed_text(s) + "\n";
  }
  return begins_with_proof(s) ? "  proof           " + without_controls(part_of(s.detail, 0)) + "\n" : "";
}

// Names and details may be of any length: they never pass through a format.
std::string headline(const Subject& p, const Answer& s) {
  return without_controls(p.name) + ": " + to_string(s.status) +
         format("  (%zu variables, %zu equalities, %zu inequalities, %zu pairs)\n", p.variables, p.equalities,
                p.inequalities, p.pairs);
}

bool is_multiplier(std::string_view letter) {
#define MARBLE_POINT(name, member, field) \
  if (letter == #name) return true;
#include "marble/contract.def"
  return false;
}

template <class Value>
void add_other(const char* name, const Value& value, Json& json) {
  if (!json.contains(name)) json[name] = value;
}
template <class Value>
void add_other(const char* name, const std::optional<Value>& value, Json& json) {
  if (value) add_other(name, *value, json);
}

// Adds the fields of solution.def that json_line does not place itself, except the multipliers, whose
// JSON has other names. JSON has no infinity: unknown values are null. Only a warm start needs the reference
// objective.
void add_others(const Solution& s, Json& json) {
#define MARBLE_SOLUTION_NUMBER(name) add_other(#name, s.name, json);
#define MARBLE_SOLUTION_OPTIONAL(name) add_other(#name, s.name, json);
#define MARBLE_SOLUTION_TEXT(name) add_other(#name, s.name, json);
#define MARBLE_SOLUTION_ENUM(name) add_other(#name, to_string(s.name), json);
#define MARBLE_SOLUTION_VECTOR(name, field, letter) \
  if (!s.name.empty() && !is_multiplier(#letter)) add_other(#name, s.name, json);
#include "marble/solution.def"
  json.erase("reference_objective");
}

SolutionFacts facts_of(const Subject& p, const Answer& s) {
  SolutionFacts facts = marble::facts_of(s, p.options);
  facts.maximize = p.maximize;
  return facts;
}

}  // namespace

Subject subject_of(const std::string& path, const ProblemFile& file, const Options& options) {
  const OwnedProblem& p = file.problem;
  return {p.name,        path,   p.g.size(), p.b.size(), p.d.size(), p.l.size(), file.best_known_objective,
          file.maximize, options};
}

std::string explanation(const Subject& p, const Answer& s) {
  std::string text = headline(p, s);
  if (s.conflict) {
    text += conflict_text(*s.conflict, p.conflict);
  } else if (is_solved(s.status)) {
    text += "  conflict        none: it has a point\n";
  } else {
    text += "  conflict        none was found: " + without_controls(s.detail) + "\n";
  }
  return text + format("  time            %.3f ms\n", 1e3 * (s.times.solve_s + s.times.setup_s));
}

std::string summary(const Subject& p, const Answer& s) {
  std::string text = headline(p, s);
  text += format("  objective       %.10g", p.of_file(s.objective));
  if (p.best_known_objective) text += format("   (best known %.10g)", *p.best_known_objective);
  const SolutionFacts facts = facts_of(p, s);
  text += "\n  answer          " + kind_text(facts) + "\n" + proof_line(p, s);
  text += format("  violations      equality %.1e, inequality %.1e, complementarity %.1e\n",
                 s.violations.equality, s.violations.inequality, s.violations.complementarity);
  text += format("  kkt residual    %.1e\n", s.kkt_residual);
  text += format("  work            %d iterations, %d factorizations", s.iterations, s.factorizations);
  if (s.nodes > 0 && !begins_with_proof(s))
    text += ", " + whole_text(s.nodes) + (s.nodes == 1 ? " node" : " nodes");
  text += "\n";
  text +=
      format("  time            %.3f ms solve, %.3f ms set-up", 1e3 * s.times.solve_s, 1e3 * s.times.setup_s);
  if (!s.job_id.empty())
    text += format(", %.3f ms in the queue", 1e3 * s.queue_s) + "  (job " + without_controls(s.job_id) + ")";
  text += "\n";
  if (is_solved(s.status)) {
    text += "  found by        " + without_controls(part_of(s.detail, begins_with_proof(s) ? 1 : 0)) + "\n";
    text += std::string("  stationarity    ") + to_string(s.stationarity) +
            (s.b_stationary.value_or(false) ? ", no descent on any branch\n" : "\n");
    text += std::string("  second order    ") + to_string(s.second_order) + "\n";
    if (const std::string reported = sensitivity_text(s); !reported.empty())
      text += "  derivatives     " + reported + "\n";
  } else {
    text += "  why             " + without_controls(s.detail) + "\n";
  }
  if (s.conflict) {
    text += p.conflict.empty() ? "  conflict        " + std::to_string(s.conflict->size()) + " parts; " +
                                     without_controls(s.conflict->detail) + "\n"
                               : conflict_text(*s.conflict, p.conflict);
  } else if (const std::string better = what_to_try(facts); !better.empty()) {
    text += "  what to try     " + better + "\n";
  }
  return text;
}

std::string json_line(const Subject& problem, const Answer& s) {
  Json json;
  json["name"] = problem.name;
  if (!problem.file.empty()) json["file"] = problem.file;
  json["status"] = to_string(s.status);
  json["kind"] = to_string(kind_of(facts_of(problem, s)));
  json["detail"] = s.detail;
  json["origin"] = to_string(s.origin);
  json["objective"] = problem.of_file(s.objective);
  if (problem.maximize) json["maximize"] = true;
  if (problem.best_known_objective) json["best_known_objective"] = *problem.best_known_objective;
  json["z"] = s.z;
  json["equality_multipliers"] = s.equality_multipliers;
  json["inequality_multipliers"] = s.inequality_multipliers;
  json["complementarity_multipliers"] = {{"L", s.complementarity_multipliers_L},
                                         {"R", s.complementarity_multipliers_R}};
  if (!s.certificate.empty()) json["certificate"] = s.certificate;
  json["violations"] = {{"equality", s.violations.equality},
                        {"inequality", s.violations.inequality},
                        {"complementarity", s.violations.complementarity}};
  json["kkt_residual"] = s.kkt_residual;
  json["stationarity"] = to_string(s.stationarity);
  if (s.b_stationary) json["b_stationary"] = *s.b_stationary;
  json["second_order"] = to_string(s.second_order);
  add_others(s, json);
  if (problem.maximize) json["bound"] = problem.of_file(s.bound);
  json["solve_seconds"] = s.times.solve_s;
  json["setup_seconds"] = s.times.setup_s;
  json["factorization_seconds"] = s.times.factorization_s;
  json["line_search_seconds"] = s.times.line_search_s;
  json["polish_seconds"] = s.times.polish_s;
  json["tree_seconds"] = s.times.tree_s;
  json["queue_seconds"] = s.queue_s;
  if (!s.job_id.empty()) json["job_id"] = s.job_id;
  if (!s.traceparent.empty()) json["traceparent"] = s.traceparent;
  if (s.conflict) json["conflict"] = conflict_json(*s.conflict, problem.conflict);
  if (s.sensitivity) json["sensitivity"] = sensitivity_json(s);
  return line(json);
}

std::string json_line(const std::string& file, const std::string& name, const Error& error) {
  Json json;
  json["name"] = name.empty() ? Json(nullptr) : Json(name);
  json["file"] = file;
  json["status"] = "error";
  json["error"] = to_json(error);
  return line(json);
}

}  // namespace marble::cli
