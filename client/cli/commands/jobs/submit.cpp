#include <iostream>
#include <memory>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "formats.h"
#include "marble/problem_file.h"
#include "output/json.h"
#include "output/report.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

struct SubmitArguments {
  std::vector<std::string> files;
  ServerArguments server;
  SolverArguments solver;
  Priority priority = Priority::by_method;
};

int tell_error(const SubmitArguments& arguments, const std::string& path, const std::string& name,
               Error error, bool remote) {
  if (error.code == ErrorCode::unavailable)
    error.bound = "server " + arguments.server.server + ": " + error.bound;
  complain(path, error.message());
  if (arguments.server.json()) std::cout << json_line(path, name, error) << '\n' << std::flush;
  return remote ? exit_code_of(error) : exit_code_of_local(error);
}

int submit_file(const SubmitArguments& arguments, const std::string& path, const Options& options,
                const Jobs& jobs, const std::stop_token& stop) {
  const auto file = formats::read_any_problem(path);
  if (!file) return tell_error(arguments, path, "", file.error(), false);
  CallControls call;
  call.problem_name = file->problem.name;
  call.priority = arguments.priority;
  const SolveControls controls{nullptr, stop, file->problem.initial_z};
  const auto job = jobs.submit(file->problem.view(), options, controls, call);
  if (!job) return tell_error(arguments, path, file->problem.name, job.error(), true);
  if (arguments.server.json()) {
    std::cout << line({{"name", file->problem.name},
                       {"file", path},
                       {"job_id", job->job_id},
                       {"queue_position", job->queue_position},
                       {"estimated_wait_seconds", job->estimated_wait_s}})
              << '\n';
  } else {
    std::cout << without_controls(job->job_id) << '\n';
  }
  std::cout << std::flush;
  return kAllSolved;
}

int run(const SubmitArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  int exit_code = kAllSolved;
  for (const std::string& path : arguments.files) {
    const int outcome =
        interrupt.token().stop_requested()
            ? tell_error(arguments, path, "",
                         failure(ErrorCode::cancelled, "not submitted: interrupted before"), false)
            : submit_file(arguments, path, *options, client->jobs(), interrupt.token());
    exit_code = worse(exit_code, outcome);
  }
  return exit_code;
}

}  // namespace

void add_submit(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<SubmitArguments>();
  CLI::App* command = program.add_subcommand(
      "submit", "Hand problem files over to be solved, and print the ids of the jobs: see result and watch");
  command->add_option("FILE", arguments->files, ".json, .pb or .bin; - is standard input")->required();
  add_server_arguments(*command, arguments->server);
  add_priority_argument(*command, arguments->priority);
  add_solver_arguments(*command, arguments->solver);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
