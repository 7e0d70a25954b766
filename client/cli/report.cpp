#include "report.h"

#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace marble::cli {
namespace {

using Json = nlohmann::ordered_json;

__attribute__((format(printf, 1, 2))) std::string format(const char* pattern, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

}  // namespace

std::string summary(const std::string& file, const ProblemFile& problem, const Answer& answer) {
  const OwnedProblem& p = problem.problem;
  const Solution& s = answer.solution;
  std::string text;
  text += format("%s: %s  (%zu variables, %zu equalities, %zu inequalities, %zu pairs)\n",
                 p.name.empty() ? file.c_str() : p.name.c_str(), to_string(s.status), p.g.size(), p.b.size(),
                 p.d.size(), p.l.size());
  text += format("  objective       %.10g", s.objective);
  if (problem.best_known_objective) text += format("   (best known %.10g)", *problem.best_known_objective);
  text += format("\n  violations      equality %.1e, inequality %.1e, complementarity %.1e\n",
                 s.violations.equality, s.violations.inequality, s.violations.complementarity);
  text += format("  kkt residual    %.1e\n", s.kkt_residual);
  text += format("  work            %d iterations, %d factorizations\n", s.iterations, s.factorizations);
  text +=
      format("  time            %.3f ms solve, %.3f ms set-up", 1e3 * s.times.solve_s, 1e3 * s.times.setup_s);
  if (!answer.job_id.empty())
    text += format(", %.3f ms in the queue  (job %s)", 1e3 * answer.queue_s, answer.job_id.c_str());
  text += "\n";
  if (!is_solved(s.status)) text += "  why             " + s.detail + "\n";
  return text;
}

std::string json_line(const std::string& file, const ProblemFile& problem, const Answer& answer) {
  const Solution& s = answer.solution;
  Json json;
  json["name"] = problem.problem.name;
  json["file"] = file;
  json["status"] = to_string(s.status);
  json["detail"] = s.detail;
  json["objective"] = s.objective;
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
  json["iterations"] = s.iterations;
  json["factorizations"] = s.factorizations;
  json["solve_seconds"] = s.times.solve_s;
  json["setup_seconds"] = s.times.setup_s;
  json["queue_seconds"] = answer.queue_s;
  if (!answer.job_id.empty()) json["job_id"] = answer.job_id;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string json_line(const std::string& file, const Error& error) {
  Json json;
  json["name"] = nullptr;
  json["file"] = file;
  json["status"] = "error";
  json["error"] = {{"code", to_string(error.code)}, {"field", error.field}, {"index", error.index},
                   {"value", error.value},          {"bound", error.bound}, {"message", error.message()}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace marble::cli
