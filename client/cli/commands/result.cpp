#include <cstdio>
#include <iostream>
#include <memory>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "output/report.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

struct ResultArguments {
  std::vector<std::string> jobs;
  ServerArguments server;
  bool wait = false;
  std::int64_t after = 0;
};

// Uses what the server still knows; it may have removed the job but kept its solution.
Subject subject_of(const Jobs& jobs, const std::string& id) {
  const auto details = jobs.get(id);
  if (!details) return {.name = id};
  const JobInfo& job = details->job;
  return {.name = job.problem_name.empty() ? id : job.problem_name,
          .variables = static_cast<std::size_t>(job.variables),
          .equalities = static_cast<std::size_t>(job.equalities),
          .inequalities = static_cast<std::size_t>(job.inequalities),
          .pairs = static_cast<std::size_t>(job.pairs),
          .options = details->options};
}

int report_result(const ResultArguments& arguments, const Jobs& jobs, const std::string& id,
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

// Prints a line per result, in the order of arrival. Without --wait only the existing ones.
int report_array(const ResultArguments& arguments, const Jobs& jobs, const std::string& id,
                 const ArrayProgress& progress, const std::stop_token& stop) {
  int outcome = kAllSolved;
  std::stop_source enough;
  const std::stop_callback pass_on(stop, [&enough] { enough.request_stop(); });
  std::int64_t reported = arguments.after;
  const auto report = [&](const ArrayAnswer& element) {
    if (!arguments.wait && reported == progress.done) return;
    reported = element.sequence;
    const std::string name = id + "[" + std::to_string(element.index) + "]";
    if (!element.answer) {
      outcome = worse(outcome, exit_code_of(element.answer.error()));
      if (arguments.server.json()) {
        std::cout << json_line("", name, element.answer.error()) << '\n';
      } else {
        std::cout << name << ": " << without_controls(element.answer.error().message()) << '\n';
      }
    } else {
      const RemoteSolution& answer = *element.answer;
      outcome = worse(outcome, is_solved(answer.status) ? kAllSolved : kNotSolved);
      if (arguments.server.json()) {
        std::cout << json_line({.name = name, .variables = answer.z.size()}, answer) << '\n';
      } else {
        std::printf("%s: %s  objective %.10g  %d factorizations  %.3f ms\n", name.c_str(),
                    to_string(answer.status), answer.objective, answer.factorizations,
                    1e3 * answer.times.solve_s);
      }
    }
    std::fflush(stdout);
    std::cout << std::flush;
    if (!arguments.wait && reported == progress.done) enough.request_stop();
  };
  if (!arguments.wait && reported >= progress.done && progress.done < progress.elements) return kNotSolved;
  const auto read = jobs.array(id, report, {.after = arguments.after, .stop = enough.get_token()});
  if (read) return outcome;
  if (!stop.stop_requested() && enough.stop_requested())
    return progress.done == progress.elements ? outcome : worse(outcome, kNotSolved);
  return worse(outcome, job_fails(arguments.server, id, read.error()));
}

int run(const ResultArguments& arguments) {
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  int exit_code = kAllSolved;
  for (const std::string& id : arguments.jobs) {
    const auto details = client->jobs().get(id);
    const bool is_array = details && details->job.kind == JobKind::array;
    exit_code = worse(exit_code, is_array ? report_array(arguments, client->jobs(), id, details->job.array,
                                                         interrupt.token())
                                          : report_result(arguments, client->jobs(), id, interrupt.token()));
  }
  return exit_code;
}

}  // namespace

void add_result(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<ResultArguments>();
  CLI::App* command =
      program.add_subcommand("result", "Print the solutions of submitted jobs, in the format of solve");
  command->add_option("JOB", arguments->jobs, "job ids printed by submit")->required();
  add_server_arguments(*command, arguments->server);
  command->add_flag("--wait", arguments->wait,
                    "wait for unfinished jobs; otherwise an unfinished job exits with 1");
  command
      ->add_option("--after", arguments->after,
                   "of an array job: skip this many solutions, to resume where an earlier call stopped")
      ->check(CLI::NonNegativeNumber);
  command->footer(std::string("Ctrl-C stops waiting; the jobs continue.\n") + kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
