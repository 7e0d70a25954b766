#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include "arguments/solve_arguments.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "commands/solve_files.h"
#include "formats.h"
#include "marble/client.h"

namespace marble::cli {
namespace {

std::string about(double wait_s) {
  char text[48] = "";
  if (wait_s > 0.0) std::snprintf(text, sizeof text, ", about %.1f s", wait_s);
  return text;
}

// The place in the queue, for a person who waits.
void tell_place(CallControls& call) {
  const auto job = std::make_shared<std::string>();
  call.accepted = [job](const std::string& job_id, int position, double wait_s) {
    *job = job_id;
    if (position > 0)
      std::fprintf(stderr, "job %s waits behind %d%s\n", job_id.c_str(), position, about(wait_s).c_str());
  };
  call.moved = [job](int position, double wait_s) {
    if (position > 0) {
      std::fprintf(stderr, "job %s waits behind %d%s\n", job->c_str(), position, about(wait_s).c_str());
    } else {
      std::fprintf(stderr, "job %s is next%s\n", job->c_str(), about(wait_s).c_str());
    }
  };
}

Expected<Answer> solve_there(const SolveArguments& arguments, const Client& client,
                             const OwnedProblem& problem, const Options& options,
                             const SolveControls& controls) {
  CallControls call;
  call.problem_name = problem.name;
  call.priority = arguments.priority;
  if (!arguments.quiet) tell_place(call);
  auto answer = client.solve(problem.view(), options, controls, call);
  if (answer && answer->progress_skipped > 0) {
    std::fprintf(stderr, "(%lld more iterations; the connection was slower than the solver)\n",
                 static_cast<long long>(answer->progress_skipped));
  }
  if (!answer && answer.error().code == ErrorCode::unavailable)
    answer.error().bound = "server " + client.address() + ": " + answer.error().bound;
  return answer;
}

int run(const SolveArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  if (arguments.here()) return solve_files(arguments, *options, {formats::read_any_problem, solve_here});
  const auto client = connect(arguments.server);
  if (!client) {
    std::cerr << "marble: " << client.error().message() << '\n';
    return kBadInput;
  }
  const auto solve = [&](const OwnedProblem& problem, const Options& own, const SolveControls& controls) {
    return solve_there(arguments, *client, problem, own, controls);
  };
  return solve_files(arguments, *options, {formats::read_any_problem, solve, true});
}

}  // namespace

void add_solve(CLI::App& program, int& exit_code) {
  const auto arguments = std::make_shared<SolveArguments>();
  add_solve_command(program, arguments)->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
