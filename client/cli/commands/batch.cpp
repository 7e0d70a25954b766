#include <cstdio>
#include <iostream>
#include <map>
#include <memory>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "formats.h"
#include "marble/problem_file.h"
#include "mutex.h"
#include "output/report.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

struct BatchArguments {
  std::vector<std::string> files;
  ServerArguments server;
  SolverArguments solver;
  Priority priority = Priority::by_method;
};

// Reads one file after the other as the server accepts them, and prints solutions as they arrive: two
// threads, one lock.
class BatchRun {
 public:
  BatchRun(const BatchArguments& arguments, const Options& options)
      : arguments_(arguments), options_(options) {}

  int run(const Client& client, const std::stop_token& stop) {
    const auto done = client.solve_batch(
        [this] { return next(); },
        [this](std::int64_t tag, const Expected<RemoteSolution>& answer) { report(tag, answer); },
        {.priority = arguments_.priority, .stop = stop, .waiting = [this](const Error& reason) {
           complain("server " + arguments_.server.server, "waits for the queue: " + reason.message());
         }});
    // One line per file, also for files that were not reached: programs count the lines.
    const MutexLock lock(mutex_);
    Error unreached = done ? Error{} : done.error();
    if (unreached.code == ErrorCode::cancelled) unreached.bound = "not solved: interrupted before";
    for (; next_ < arguments_.files.size(); ++next_)
      report_error(arguments_.files[next_], "", unreached, true);
    return exit_code_;
  }

 private:
  std::optional<BatchProblem> next() {
    while (true) {
      std::string path;
      {
        const MutexLock lock(mutex_);
        if (next_ == arguments_.files.size()) return std::nullopt;
        path = arguments_.files[next_];
      }
      auto file = formats::read_any_problem(path);
      const MutexLock lock(mutex_);
      const auto tag = static_cast<std::int64_t>(next_++);
      if (!file) {
        report_error(path, "", file.error(), false);
        continue;
      }
      file_ = std::move(*file);
      subjects_[tag] = subject_of(path, file_, options_);
      const OwnedProblem& p = file_.problem;
      return BatchProblem{tag, p.view(), options_, p.initial_z, p.name, ""};
    }
  }

  void report(std::int64_t tag, const Expected<RemoteSolution>& answer) {
    const MutexLock lock(mutex_);
    const Subject subject = std::move(subjects_.extract(tag).mapped());
    if (!answer) return report_error(subject.file, subject.name, answer.error(), true);
    if (arguments_.server.json()) {
      std::cout << json_line(subject, *answer) << '\n' << std::flush;
    } else {
      std::printf("%s: %s  objective %.10g  %d factorizations  %.3f ms\n",
                  without_controls(subject.file).c_str(), to_string(answer->status),
                  subject.of_file(answer->objective), answer->factorizations, 1e3 * answer->times.solve_s);
      std::fflush(stdout);
    }
    exit_code_ = worse(exit_code_, is_solved(answer->status) ? kAllSolved : kNotSolved);
  }

  void report_error(const std::string& path, const std::string& name, Error error, bool remote)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (error.code == ErrorCode::unavailable)
      error.bound = "server " + arguments_.server.server + ": " + error.bound;
    complain(path, error.message());
    if (arguments_.server.json()) std::cout << json_line(path, name, error) << '\n' << std::flush;
    exit_code_ = worse(exit_code_, remote ? exit_code_of(error) : exit_code_of_local(error));
  }

  const BatchArguments& arguments_;
  const Options& options_;
  Mutex mutex_;
  std::size_t next_ ABSL_GUARDED_BY(mutex_) = 0;
  ProblemFile file_ ABSL_GUARDED_BY(mutex_);  // borrowed by the batch until it requests the next one
  std::map<std::int64_t, Subject> subjects_ ABSL_GUARDED_BY(mutex_);
  int exit_code_ ABSL_GUARDED_BY(mutex_) = kAllSolved;
};

int run(const BatchArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  warn_of_idle_options(arguments.solver, *options);
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  return BatchRun(arguments, *options).run(*client, interrupt.token());
}

}  // namespace

void add_batch(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<BatchArguments>();
  CLI::App* command = program.add_subcommand(
      "batch", "Solve many problem files at once and print one line per result, in order of completion");
  command
      ->add_option("FILE", arguments->files,
                   "problem files: .json, .pb, .bin, .npz, .nl or folders; - is standard input")
      ->required();
  add_server_arguments(*command, arguments->server);
  add_priority_argument(*command, arguments->priority);
  add_solver_arguments(*command, arguments->solver);
  command->footer(kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
