// Implements cancel and delete: both end a job, and delete removes its solution too.
#include <iostream>
#include <memory>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "output/job_report.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

struct EndArguments {
  std::vector<std::string> jobs;
  ServerArguments server;
};

int cancel_job(const EndArguments& arguments, const Jobs& jobs, const std::string& id) {
  const auto job = jobs.cancel(id);
  if (!job) return job_fails(arguments.server, id, job.error());
  if (arguments.server.json()) {
    std::cout << line(to_json(*job)) << '\n';
  } else {
    // A running solve ends with its current iteration, shortly after.
    const bool over = job->state == JobState::finished;
    std::cout << without_controls(id) << (over ? " has ended: " + ending(*job) : " will end") << '\n';
  }
  return kAllSolved;
}

int delete_job(const EndArguments& arguments, const Jobs& jobs, const std::string& id) {
  if (const auto removed = jobs.remove(id); !removed) return job_fails(arguments.server, id, removed.error());
  if (arguments.server.json()) {
    std::cout << line({{"job_id", id}, {"deleted", true}}) << '\n';
  } else {
    std::cout << without_controls(id) << " is deleted\n";
  }
  return kAllSolved;
}

using Action = int (*)(const EndArguments&, const Jobs&, const std::string&);

int run(const EndArguments& arguments, Action action) {
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  int exit_code = kAllSolved;
  for (const std::string& id : arguments.jobs)
    exit_code = worse(exit_code, action(arguments, client->jobs(), id));
  return exit_code;
}

void add_command(CLI::App& program, int& exit_code, const char* name, const char* description,
                 Action action) {
  auto arguments = std::make_shared<EndArguments>();
  CLI::App* command = program.add_subcommand(name, description);
  command->add_option("JOB", arguments->jobs, "job ids printed by submit or jobs")->required();
  add_server_arguments(*command, arguments->server);
  command->callback([arguments, action, &exit_code] { exit_code = run(*arguments, action); });
}

}  // namespace

void add_cancel(CLI::App& program, int& exit_code) {
  add_command(program, exit_code, "cancel", "Cancel jobs; a running job returns its best iterate",
              &cancel_job);
}

void add_delete(CLI::App& program, int& exit_code) {
  add_command(program, exit_code, "delete", "Delete submitted jobs and their solutions", &delete_job);
}

}  // namespace marble::cli
