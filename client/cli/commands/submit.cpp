#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>

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
  bool array = false;
  std::string request_id;
  ServerArguments server;
  SolverArguments solver;
  Priority priority = Priority::by_method;
  std::optional<double> queue_wait;

  [[nodiscard]] std::optional<std::chrono::duration<double>> wait() const {
    if (!queue_wait) return std::nullopt;
    return std::chrono::duration<double>(*queue_wait);
  }
};

// Reports once that the server is full, however many files wait for it.
class WaitReport {
 public:
  void operator()(const std::string& subject, const Error& reason) {
    if (!std::exchange(is_made_, true)) complain(subject, "waits for the server: " + reason.message());
  }

 private:
  bool is_made_ = false;
};

int report_error(const SubmitArguments& arguments, const std::string& path, const std::string& name,
                 Error error, bool remote) {
  if (error.code == ErrorCode::unavailable)
    error.bound = "server " + arguments.server.server + ": " + error.bound;
  complain(path, error.message());
  if (arguments.server.json()) std::cout << json_line(path, name, error) << '\n' << std::flush;
  return remote ? exit_code_of(error) : exit_code_of_local(error);
}

int submit_file(const SubmitArguments& arguments, const std::string& path, const Options& options,
                const Jobs& jobs, const std::stop_token& stop, WaitReport& waiting) {
  const auto file = formats::read_any_problem(path);
  if (!file) return report_error(arguments, path, "", file.error(), false);
  if (file->maximize) complain(path, formats::kNegativeOfMaximum);
  CallControls call;
  call.problem_name = file->problem.name;
  call.priority = arguments.priority;
  call.queue_wait = arguments.wait();
  call.waiting = [&](const Error& reason) { waiting(path, reason); };
  const SolveControls controls{nullptr, stop, file->problem.initial_z};
  const auto job = jobs.submit(file->problem.view(), options, controls, call);
  if (!job) return report_error(arguments, path, file->problem.name, job.error(), true);
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

// Returns the files of a directory in the order of their names.
Expected<std::vector<std::string>> files_of(const std::vector<std::string>& given) {
  std::vector<std::string> files;
  for (const std::string& path : given) {
    std::error_code fault;
    if (!std::filesystem::is_directory(path, fault)) {
      files.push_back(path);
      continue;
    }
    std::vector<std::string> inside;
    for (const auto& entry : std::filesystem::directory_iterator(path, fault))
      if (entry.is_regular_file(fault)) inside.push_back(entry.path().string());
    if (fault) return unexpected(invalid(path, fault.message()));
    std::sort(inside.begin(), inside.end());
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

// Submits all files as one job. A file that cannot be read ends the submission.
int submit_array(const SubmitArguments& arguments, const Options& options, const Jobs& jobs,
                 const std::stop_token& stop) {
  const auto files = files_of(arguments.files);
  if (!files) return report_error(arguments, files.error().field, "", files.error(), false);
  std::stop_source given_up;
  const std::stop_callback pass_on(stop, [&given_up] { given_up.request_stop(); });
  std::size_t next = 0;
  ProblemFile file;
  std::optional<std::pair<std::string, Error>> fault;
  const ArraySource source = [&]() -> std::optional<ArrayElement> {
    if (next == files->size()) return std::nullopt;
    const std::string& path = (*files)[next++];
    auto read = formats::read_any_problem(path);
    if (!read) {
      fault = {path, read.error()};
      given_up.request_stop();
      return std::nullopt;
    }
    file = std::move(*read);
    if (file.maximize) complain(path, formats::kNegativeOfMaximum);
    const OwnedProblem& problem = file.problem;
    return ArrayElement{
        .problem = problem.view(), .initial_z = problem.initial_z, .problem_name = problem.name};
  };
  const auto array =
      jobs.submit_array(source, {.options = options,
                                 .priority = arguments.priority,
                                 .request_id = arguments.request_id,
                                 .stop = given_up.get_token(),
                                 .queue_wait = arguments.wait(),
                                 .waiting = [](const Error& reason) { WaitReport()("array", reason); }});
  if (fault) return report_error(arguments, fault->first, "", fault->second, false);
  if (!array) return report_error(arguments, "array", "", array.error(), true);
  if (arguments.server.json()) {
    std::cout << line({{"job_id", array->job_id}, {"elements", array->elements}}) << '\n';
  } else {
    std::cout << without_controls(array->job_id) << '\n';
  }
  std::cout << std::flush;
  return kAllSolved;
}

int run(const SubmitArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  warn_of_idle_options(arguments.solver, *options);
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  if (arguments.array) return submit_array(arguments, *options, client->jobs(), interrupt.token());
  WaitReport waiting;
  int exit_code = kAllSolved;
  for (const std::string& path : arguments.files) {
    const int outcome =
        interrupt.token().stop_requested()
            ? report_error(arguments, path, "",
                           failure(ErrorCode::cancelled, "not submitted: interrupted before"), false)
            : submit_file(arguments, path, *options, client->jobs(), interrupt.token(), waiting);
    exit_code = worse(exit_code, outcome);
  }
  return exit_code;
}

}  // namespace

void add_submit(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<SubmitArguments>();
  CLI::App* command = program.add_subcommand(
      "submit", "Submit problem files as jobs and print the jobs' ids; see result and watch");
  command->add_option("FILE", arguments->files, ".json, .pb or .bin; - is standard input")->required();
  add_server_arguments(*command, arguments->server);
  CLI::Option* array = command->add_flag("--array", arguments->array,
                                         "submit all files, and all files in directories, as one array job; "
                                         "prints its id, and result prints its solutions");
  command
      ->add_option("--request-id", arguments->request_id,
                   "id chosen by the client for an array job: a repeated submission with the same id by the "
                   "same client (token or MARBLE_CLIENT_NAME) returns the same job")
      ->needs(array);
  command
      ->add_option(
          "--queue-wait", arguments->queue_wait,
          "seconds to wait for space while the server's queue, or the client's share of it, is full; "
          "default: 10")
      ->check(CLI::NonNegativeNumber);
  add_priority_argument(*command, arguments->priority);
  add_solver_arguments(*command, arguments->solver);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
