#include <iostream>
#include <memory>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "output/report.h"

namespace marble::cli {
namespace {

struct ResultArguments {
  std::vector<std::string> jobs;
  ServerArguments server;
  bool wait = false;
};

// Of what the server still knows; the job may be forgotten although its answer is kept.
Subject subject_of(const Jobs& jobs, const std::string& id) {
  const auto details = jobs.get(id);
  if (!details) return {.name = id};
  const JobInfo& job = details->job;
  return {.name = job.problem_name.empty() ? id : job.problem_name,
          .variables = static_cast<std::size_t>(job.variables),
          .equalities = static_cast<std::size_t>(job.equalities),
          .inequalities = static_cast<std::size_t>(job.inequalities),
          .pairs = static_cast<std::size_t>(job.pairs)};
}

int tell_result(const ResultArguments& arguments, const Jobs& jobs, const std::string& id,
                const std::stop_token& stop) {
  const auto answer = jobs.result(id, {.wait = arguments.wait, .stop = stop});
  if (!answer) {
    const int outcome = job_fails(arguments.server, id, answer.error());
    return answer.error().code == ErrorCode::failed_precondition ? kNotSolved : outcome;  // not finished yet
  }
  const Subject subject = subject_of(jobs, id);
  if (arguments.server.json()) {
    std::cout << json_line(subject, *answer) << '\n';
  } else {
    std::cout << summary(subject, *answer);
  }
  std::cout << std::flush;
  return is_solved(answer->status) ? kAllSolved : kNotSolved;
}

int run(const ResultArguments& arguments) {
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  int exit_code = kAllSolved;
  for (const std::string& id : arguments.jobs)
    exit_code = worse(exit_code, tell_result(arguments, client->jobs(), id, interrupt.token()));
  return exit_code;
}

}  // namespace

void add_result(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<ResultArguments>();
  CLI::App* command = program.add_subcommand("result", "Print the answers of submitted jobs, as solve does");
  command->add_option("JOB", arguments->jobs, "ids, as submit printed them")->required();
  add_server_arguments(*command, arguments->server);
  command->add_flag("--wait", arguments->wait, "wait for those that have not finished; else they exit 1");
  command->footer(std::string("Ctrl-C ends the waiting, not the jobs.\n") + kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
