#include <iostream>
#include <map>
#include <memory>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "output/job_report.h"
#include "output/text_table.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

constexpr std::size_t kLongestText = 28;  // of a client's or a problem's name in the table

struct JobsArguments {
  ServerArguments server;
  JobQuery query;
};

std::string activity_text(const JobInfo& job) {
  if (job.kind == JobKind::array && job.state == JobState::running)
    return std::to_string(job.array.done) + " of " + std::to_string(job.array.elements) + " elements";
  return job.activity ? describe(*job.activity) : "-";
}

void print_table(const JobPage& page) {
  TextTable table({"job", "kind", "state", "priority", "client", "name", "n/n_e/n_i/n_c", "status",
                   "iterations", "age", "time", "activity"});
  for (const JobInfo& job : page.jobs) {
    const bool waits = job.state == JobState::queued;
    table.add({job.job_id, to_string(job.kind),
               to_string(job.state) + (waits ? " behind " + std::to_string(job.queue_position) : ""),
               to_string(job.priority), terminal_text(job.client, kLongestText),
               terminal_text(job.problem_name, kLongestText), sizes_text(job), ending(job),
               std::to_string(job.iterations), age_text(job),
               job.total_s > 0.0 ? duration_text(job.total_s) : "-", activity_text(job)});
  }
  std::cout << table.text();
  if (page.more) std::cout << "and more: --before " << without_controls(page.jobs.back().job_id) << '\n';
}

int run(const JobsArguments& arguments) {
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const auto page = client->jobs().list(arguments.query);
  if (!page) return server_fails(arguments.server, page.error());
  if (arguments.server.json()) {
    for (const JobInfo& job : page->jobs) std::cout << line(to_json(job)) << '\n';
  } else {
    print_table(*page);
  }
  return kAllSolved;
}

}  // namespace

void add_jobs(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<JobsArguments>();
  CLI::App* command = program.add_subcommand("jobs", "List a server's jobs, newest first");
  add_server_arguments(*command, arguments->server);
  const std::map<std::string, JobState> states = {{"queued", JobState::queued},
                                                  {"running", JobState::running},
                                                  {"idle", JobState::idle},
                                                  {"finished", JobState::finished}};
  command
      ->add_option("--state", arguments->query.states,
                   "only jobs in this state: queued, running, idle or finished; may be repeated")
      ->allow_extra_args(false)
      ->transform(CLI::CheckedTransformer(states).description(""))
      ->type_name("TEXT:{queued,running,idle,finished}");
  command->add_option("--client", arguments->query.client, "only jobs of this client");
  command->add_option("--limit", arguments->query.limit, "largest number of jobs; 0: 100")
      ->check(CLI::Range(0, 10000));
  command->add_option("--before", arguments->query.before_job_id,
                      "only jobs older than this one, to list the next page");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
