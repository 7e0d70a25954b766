#include "output/job_report.h"

#include <algorithm>
#include <chrono>

#include "base/exit_code.h"

namespace marble::cli {

std::string ending(const JobInfo& job) {
  if (job.error) return std::string("error: ") + to_string(job.error->code);
  return job.status ? to_string(*job.status) : "-";
}

std::string duration_text(double seconds) {
  if (seconds < 1.0) return formatted("%.3g ms", 1e3 * seconds);
  if (seconds < 120.0) return formatted("%.3g s", seconds);
  if (seconds < 7200.0) return formatted("%.0f min", seconds / 60.0);
  if (seconds < 172800.0) return formatted("%.0f h", seconds / 3600.0);
  return formatted("%.0f d", seconds / 86400.0);
}

std::string age_text(const JobInfo& job) {
  const double now =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  const double age = std::max(0.0, now - job.accepted_unix_s);  // clocks differ
  return age < 1.0 ? "now" : duration_text(age);
}

std::string sizes_text(const JobInfo& job) {
  return std::to_string(job.variables) + "/" + std::to_string(job.equalities) + "/" +
         std::to_string(job.inequalities) + "/" + std::to_string(job.pairs);
}

Json to_json(const JobInfo& job) {
  Json json{{"job_id", job.job_id},
            {"kind", to_string(job.kind)},
            {"state", to_string(job.state)},
            {"priority", to_string(job.priority)},
            {"client", job.client},
            {"request_id", job.request_id},
            {"name", job.problem_name},
            {"variables", job.variables},
            {"equalities", job.equalities},
            {"inequalities", job.inequalities},
            {"pairs", job.pairs},
            {"accepted_unix_seconds", job.accepted_unix_s}};
  if (job.state == JobState::queued) {
    json["queue_position"] = job.queue_position;
    json["estimated_wait_seconds"] = job.estimated_wait_s;
  }
  if (job.status) json["status"] = to_string(*job.status);
  if (job.error) {
    json["status"] = "error";
    json["error"] = to_json(*job.error);
  }
  json["iterations"] = job.iterations;
  json["factorizations"] = job.factorizations;
  json["objective"] = job.objective;
  json["violations"] = {{"equality", job.violations.equality},
                        {"inequality", job.violations.inequality},
                        {"complementarity", job.violations.complementarity}};
  if (job.status) json["proved"] = job.proved;
  if (job.nodes > 0) add_tree(job, json);
  json["queue_seconds"] = job.queue_s;
  json["setup_seconds"] = job.times.setup_s;
  json["solve_seconds"] = job.times.solve_s;
  json["factorization_seconds"] = job.times.factorization_s;
  json["line_search_seconds"] = job.times.line_search_s;
  json["polish_seconds"] = job.times.polish_s;
  json["tree_seconds"] = job.times.tree_s;
  if (job.activity) json["activity"] = describe(*job.activity);
  json["total_seconds"] = job.total_s;
  if (job.kind == JobKind::session) json["updates"] = job.updates;
  if (job.kind == JobKind::array)
    json["array"] = {{"elements", job.array.elements},
                     {"done", job.array.done},
                     {"solved", job.array.solved},
                     {"failed", job.array.failed}};
  json["memory_bytes"] = job.memory_bytes;
  json["result_bytes"] = job.result_bytes;
  if (!job.detail.empty()) json["detail"] = job.detail;
  if (!job.trace_id.empty()) json["trace_id"] = job.trace_id;
  if (!job.server.empty()) json["server"] = job.server;
  if (job.finished_unix_s > 0.0) json["finished_unix_seconds"] = job.finished_unix_s;
  return json;
}

Json to_json(const Progress& row) {
  Json json{{"iteration", row.iteration},
            {"outer_iteration", row.outer_iteration},
            {"objective", row.objective},
            {"equality", row.violations.equality},
            {"inequality", row.violations.inequality},
            {"complementarity", row.violations.complementarity},
            {"kkt_residual", row.kkt_residual},
            {"kappa", row.kappa},
            {"rho", row.rho},
            {"step_length", row.step_length},
            {"regularization", row.regularization},
            {"factorizations", row.factorizations},
            {"elapsed_seconds", row.elapsed_s}};
  if (row.nodes > 0) add_tree(row, json);
  return json;
}

int exit_code_of(const JobInfo& job) {
  if (job.error) return exit_code_of(*job.error);
  return job.status && is_solved(*job.status) ? kAllSolved : kNotSolved;
}

}  // namespace marble::cli
