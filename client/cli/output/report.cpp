#include "output/report.h"

#include <cstdarg>
#include <cstdio>
#include <optional>
#include <string_view>

#include "marble/report/solution_kind.h"
#include "output/json.h"
#include "output/proof.h"
#include "output/sensitivity_report.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

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
