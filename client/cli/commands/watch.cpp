#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <memory>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "output/job_report.h"
#include "output/proof.h"
#include "output/text_table.h"
#include "plain_text.h"
#include "watch/live_view.h"

namespace marble::cli {
namespace {

struct WatchArguments {
  ServerArguments server;
  std::string job;  // empty: all
  double interval_s = 0.2;
  bool plain = false;
};

std::string text_of(const JobEvent& event) {
  const JobInfo& job = event.job;
  std::string text = without_controls(job.job_id) + " " + to_string(job.state);
  const auto add = [&text](const char* pattern, auto... values) {
    char part[160];
    std::snprintf(part, sizeof part, pattern, values...);
    text += part;
  };
  if (!job.problem_name.empty()) text += "  " + terminal_text(job.problem_name, 40);
  if (job.state == JobState::queued) {
    add("  behind %d", job.queue_position);
    if (job.estimated_wait_s > 0.0) text += ", about " + duration_text(job.estimated_wait_s);
  }
  if (job.state == JobState::finished) text += "  " + ending(job);
  if (job.kind == JobKind::session) add("  %lld updates", static_cast<long long>(job.updates));
  if (job.kind == JobKind::array)
    add("  %lld of %lld", static_cast<long long>(job.array.done), static_cast<long long>(job.array.elements));
  if (job.iterations > 0) {
    add("  iteration %lld, objective %.7e, complementarity %.1e", static_cast<long long>(job.iterations),
        job.objective, job.violations.complementarity);
  }
  if (job.nodes > 0) text += ", " + proof_text(proof_of(job));
  if (job.state == JobState::finished) text += ", " + duration_text(job.total_s);
  return text;
}

Json json_of(const JobEvent& event) {
  Json json = to_json(event.job);
  json["rows"] = Json::array();
  if (event.trace) {
    for (const Progress& row : event.trace->rows) json["rows"].push_back(to_json(row));
  }
  for (const Progress& row : event.rows) json["rows"].push_back(to_json(row));
  json["skipped"] = event.skipped;
  return json;
}

int watch_plainly(const WatchArguments& arguments, const Client& client) {
  const Interrupt interrupt;
  int outcome = kNotSolved;
  const auto report = [&](const JobEvent& event) {
    std::cout << (arguments.server.json() ? line(json_of(event)) : text_of(event)) << '\n' << std::flush;
    if (event.job.state == JobState::finished) outcome = exit_code_of(event.job);
  };
  const auto watched = client.jobs().watch(arguments.job, report, {arguments.interval_s, interrupt.token()});
  if (watched) return outcome;
  const bool all = arguments.job.empty();
  if (all && interrupt.token().stop_requested()) return kAllSolved;  // the only way to end it
  return all ? server_fails(arguments.server, watched.error())
             : job_fails(arguments.server, arguments.job, watched.error());
}

bool wants_live(const WatchArguments& arguments) {
  const char* terminal = std::getenv("TERM");
  const std::string name = terminal == nullptr ? "" : terminal;
  return !arguments.plain && !arguments.server.json() && name != "dumb" && !name.empty() &&
         isatty(STDIN_FILENO) == 1 && isatty(STDOUT_FILENO) == 1;
}

// The screen has closed: prints one line of what it showed.
int leave(const WatchArguments& arguments, const LiveEnd& end) {
  if (end.refusal) return server_fails(arguments.server, *end.refusal);
  if (end.job) std::cout << text_of({*end.job, {}, {}, 0}) << '\n' << std::flush;
  if (end.signal != 0 && end.signal != SIGINT) {
    std::signal(end.signal, SIG_DFL);
    std::raise(end.signal);
  }
  if (arguments.job.empty()) return kAllSolved;
  return end.job && end.job->state == JobState::finished ? exit_code_of(*end.job) : kNotSolved;
}

int run(const WatchArguments& arguments) {
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  if (!wants_live(arguments)) return watch_plainly(arguments, *client);
  // Errors of the server are reported before a screen is opened.
  if (const auto info = client->info(); !info) return server_fails(arguments.server, info.error());
  if (!arguments.job.empty()) {
    const auto details = client->jobs().get(arguments.job);
    if (!details) return job_fails(arguments.server, arguments.job, details.error());
  }
  auto screen = Screen::open();
  if (!screen) return watch_plainly(arguments, *client);
  return leave(arguments, watch_live(*client, arguments.job, std::move(screen)));
}

}  // namespace

void add_watch(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<WatchArguments>();
  CLI::App* command = program.add_subcommand(
      "watch", "Follow one job until it ends, or all jobs: live on a terminal, otherwise one line per event");
  command->add_option("JOB", arguments->job, "job id; default: all jobs");
  add_server_arguments(*command, arguments->server);
  command
      ->add_option("--interval", arguments->interval_s,
                   "smallest number of seconds between two lines of a job's progress")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  command->add_flag("--plain", arguments->plain, "print lines on a terminal too, as with TERM=dumb");
  command->footer(
      std::string("On a terminal, ? lists the keys. With JOB, the exit code is that of solve.\n") +
      kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
