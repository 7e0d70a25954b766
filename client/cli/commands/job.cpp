#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <memory>
#include <utility>

#include "arguments/server_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/option_text.h"
#include "commands/commands.h"
#include "output/conflict_text.h"
#include "output/iteration_table.h"
#include "output/job_report.h"
#include "output/proof.h"
#include "output/text_table.h"
#include "output/trace_file.h"
#include "replay/bundle_file.h"

namespace marble::cli {
namespace {

struct JobArguments {
  ServerArguments server;
  std::string job;
  std::string trace, bundle;
};

void field(const char* name, const std::string& text) {
  std::printf("%-14s %s\n", name, terminal_text(text).c_str());
}

std::string violations_text(const Violations& violations) {
  return formatted("equality %.1e", violations.equality) +
         formatted(", inequality %.1e", violations.inequality) +
         formatted(", complementarity %.1e", violations.complementarity);
}

std::string time_text(double unix_s) {
  const auto seconds = static_cast<std::time_t>(unix_s);
  std::tm utc = {};
  char text[32] = "";
  if (gmtime_r(&seconds, &utc) != nullptr) std::strftime(text, sizeof text, "%F %T UTC", &utc);
  return text;
}

void print_options(const Options& options) {
  const Options defaults;
  bool any = false;
  for (const OptionInfo& option : option_table()) {
    const double value = get_option(options, option.name);
    if (value == get_option(defaults, option.name)) continue;
    field(any ? "" : "options", std::string(option.name) + "=" + option_text(option, value));
    any = true;
  }
  if (!any) field("options", "all default");
}

// "equalities 0, 3; left sides 2"
std::string parts_text(const Conflict& conflict) {
  std::string text;
  for (const ConflictKind& kind : kConflictKinds) {
    const std::vector<Index>& indices = conflict.*kind.indices;
    for (std::size_t k = 0; k < indices.size(); ++k) {
      text += k > 0 ? ", " : (text.empty() ? "" : "; ") + std::string(kind.several) + " ";
      text += std::to_string(indices[k]);
    }
  }
  return text;
}

// "inequality 3" for a position in the certificate.
std::string row_text(const JobInfo& job, Index row) {
  std::size_t kind = 0;
  for (const Index count : {job.equalities, job.inequalities, job.pairs, job.pairs}) {
    if (row < count) return kConflictKinds[kind].one + (" " + std::to_string(row));
    row -= count;
    ++kind;
  }
  return "row " + std::to_string(row);
}

void print(const JobInfo& job, const Infeasibility& why) {
  const auto more = [](std::int64_t count) {
    return count > 0 ? ", and " + std::to_string(count) + " more" : std::string();
  };
  if (why.conflict) {
    field("conflict", parts_text(*why.conflict) + more(why.more_parts) +
                          (why.conflict->minimal ? "; minimal" : "; perhaps fewer conflict already"));
  }
  std::string text;
  for (std::size_t k = 0; k < std::min(why.rows.size(), why.multipliers.size()); ++k)
    text += (k > 0 ? ", " : "") + row_text(job, why.rows[k]) + formatted(": %.4g", why.multipliers[k]);
  if (!text.empty()) field("certificate", text + more(why.more_rows));
}

void print(const JobDetails& details) {
  const JobInfo& job = details.job;
  field("job", job.job_id);
  field("kind", std::string(to_string(job.kind)) + ", " + to_string(job.priority));
  field("client", job.client);
  if (!job.request_id.empty()) field("request", job.request_id);
  if (!job.trace_id.empty()) field("trace", job.trace_id);
  if (!job.server.empty()) field("server", job.server);
  field("problem", job.problem_name + "  " + sizes_text(job) + " (n/n_e/n_i/n_c)");
  field("accepted", time_text(job.accepted_unix_s) + ", age " + age_text(job));
  field("state", to_string(job.state));
  if (job.state == JobState::queued) {
    field("waits",
          "behind " + std::to_string(job.queue_position) + ", about " + duration_text(job.estimated_wait_s));
  }
  field("status", ending(job));
  if (job.error) field("why", job.error->message());
  if (!job.detail.empty()) field("detail", job.detail);
  if (details.infeasibility) print(job, *details.infeasibility);
  if (job.kind == JobKind::session) field("updates", std::to_string(job.updates));
  if (job.kind == JobKind::array)
    field("elements", std::to_string(job.array.done) + " of " + std::to_string(job.array.elements));
  field("work", std::to_string(job.iterations) + " iterations, " + std::to_string(job.factorizations) +
                    " factorizations");
  field("objective", formatted("%.10g", job.objective));
  if (job.nodes > 0) {
    field("incumbent", std::isfinite(job.incumbent) ? formatted("%.10g", job.incumbent) : "none yet");
    field("proof", proof_text(proof_of(job)));
  }
  field("violations", violations_text(job.violations));
  field("time", duration_text(job.queue_s) + " queue, " + duration_text(job.times.setup_s) + " set-up, " +
                    duration_text(job.times.solve_s) + " solve, " + duration_text(job.total_s) + " in all");
  field("solve", duration_text(job.times.factorization_s) + " factorizations, " +
                     duration_text(job.times.line_search_s) + " line search, " +
                     duration_text(job.times.polish_s) + " polish, " + duration_text(job.times.tree_s) +
                     " tree");
  field("memory", std::to_string(job.memory_bytes) + " bytes");
  field("answer", job.result_bytes > 0 ? std::to_string(job.result_bytes) + " bytes kept" : "none kept");
  print_options(details.options);
  if (details.trace.rows.empty()) return;
  field("convergence", details.trace.stride > 1
                           ? "every " + std::to_string(details.trace.stride) + "th iteration, and the newest"
                           : "every iteration");
  IterationTable table(false, stdout);
  for (const Progress& row : details.trace.rows) table.report(row);
}

Json json_of(const JobDetails& details) {
  Json json = to_json(details.job);
  for (const OptionInfo& option : option_table()) {
    const double value = get_option(details.options, option.name);
    Json& entry = json["options"][std::string(option.name)];
    switch (option.type) {
      case OptionType::real:
        entry = value;
        break;
      case OptionType::integer:
        entry = static_cast<std::int64_t>(value);
        break;
      case OptionType::boolean:
        entry = value != 0.0;
        break;
      case OptionType::choice:
        entry = option_text(option, value);
        break;
    }
  }
  if (const auto& why = details.infeasibility) {
    Json& entry = json["infeasibility"];
    if (why->conflict) entry["conflict"] = conflict_json(*why->conflict, {});
    entry["more_parts"] = why->more_parts;
    entry["rows"] = why->rows;
    entry["multipliers"] = why->multipliers;
    entry["more_rows"] = why->more_rows;
  }
  json["trace_stride"] = details.trace.stride;
  json["trace"] = Json::array();
  for (const Progress& row : details.trace.rows) json["trace"].push_back(to_json(row));
  return json;
}

Expected<void> write_trace(const JobTrace& trace, const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(auto writer, TraceWriter::open(path));
  for (const Progress& row : trace.rows) writer.report(row);
  return writer.commit();
}

int write_job_bundle(const JobArguments& arguments, const Jobs& jobs) {
  const auto parts = jobs.bundle(arguments.job);
  if (!parts) return job_fails(arguments.server, arguments.job, parts.error());
  const auto written = save_bundle(*parts, arguments.bundle);
  if (written) return kAllSolved;
  complain(written.error().message());
  return kBadInput;
}

int run(const JobArguments& arguments) {
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  if (!arguments.bundle.empty()) return write_job_bundle(arguments, client->jobs());
  const auto details = client->jobs().get(arguments.job);
  if (!details) return job_fails(arguments.server, arguments.job, details.error());
  if (arguments.server.json()) {
    std::cout << line(json_of(*details)) << '\n';
  } else {
    print(*details);
  }
  if (arguments.trace.empty()) return kAllSolved;
  const auto written = write_trace(details->trace, arguments.trace);
  if (written) return kAllSolved;
  complain(written.error().message());
  return kBadInput;
}

}  // namespace

void add_job(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<JobArguments>();
  CLI::App* command = program.add_subcommand("job", "Show a job: its state, options and convergence");
  command->add_option("JOB", arguments->job, "job id")->required();
  add_server_arguments(*command, arguments->server);
  command->add_option("--trace", arguments->trace, "also write the convergence to this file, as CSV");
  command
      ->add_option("--bundle", arguments->bundle,
                   "write the job with its problem and solution to this .tar.zst file instead, for a bug "
                   "report (see: marble replay)")
      ->excludes(command->get_option("--trace"));
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
