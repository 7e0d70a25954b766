#include <chrono>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "formats.h"
#include "marble/client.h"
#include "marble/contract.h"
#include "marble/problem_file.h"
#include "output/iteration_table.h"
#include "output/report.h"
#include "trace/trace_file.h"

namespace marble::cli {
namespace {

struct SolveArguments {
  std::vector<std::string> files;
  ServerArguments server;
  SolverArguments solver;
  Priority priority = Priority::by_method;
  bool local = false;
  bool quiet = false;
  std::string trace;  // empty: none is written
  [[nodiscard]] bool json() const { return server.json(); }
};

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

// Who is told of each iteration: the person, the trace, both or nobody.
class Listeners final : public ProgressSink {
 public:
  Listeners(bool tells, TraceWriter* trace) : table_(colours_wanted()), tells_(tells), trace_(trace) {}
  void report(const Progress& progress) override {
    if (tells_) table_.report(progress);
    if (trace_ != nullptr) trace_->report(progress);
  }
  [[nodiscard]] ProgressSink* sink() { return tells_ || trace_ != nullptr ? this : nullptr; }

 private:
  IterationTable table_;
  bool tells_;
  TraceWriter* trace_;
};

// `remote`: the error may be the server's.
int tell_error(const SolveArguments& arguments, const std::string& file, const std::string& name,
               const Error& error, bool remote) {
  std::cerr << "marble: " << file << ": " << error.message() << '\n';
  if (arguments.json()) std::cout << json_line(file, name, error) << '\n' << std::flush;
  return remote ? exit_code_of(error) : exit_code_of_local(error);
}

// The solver's own contract: a stopped one answers with its best iterate.
Expected<Answer> solve_here(const OwnedProblem& problem, const Options& options,
                            const SolveControls& controls) {
  const auto begun = std::chrono::steady_clock::now();
  auto solution = solve_in_process(problem.view(), options, controls);
  if (!solution) return unexpected(std::move(solution.error()));
  Answer answer;
  static_cast<Solution&>(answer) = std::move(*solution);
  answer.total_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return answer;
}

Expected<Answer> answer_to(const SolveArguments& arguments, const OwnedProblem& problem,
                           const Options& options, const Client* client, TraceWriter* trace,
                           std::stop_token stop) {
  Listeners listeners(!arguments.quiet, trace);
  const SolveControls controls{listeners.sink(), std::move(stop), problem.initial_z};
  if (client == nullptr) return solve_here(problem, options, controls);
  CallControls call;
  call.problem_name = problem.name;
  call.priority = arguments.priority;
  if (!arguments.quiet) tell_place(call);
  auto answer = client->solve(problem.view(), options, controls, call);
  if (answer && answer->progress_skipped > 0) {
    std::fprintf(stderr, "(%lld more iterations; the connection was slower than the solver)\n",
                 static_cast<long long>(answer->progress_skipped));
  }
  if (!answer && answer.error().code == ErrorCode::unavailable)
    answer.error().bound = "server " + client->address() + ": " + answer.error().bound;
  return answer;
}

// Here if there is no client.
int solve_file(const SolveArguments& arguments, const std::string& path, const Options& options,
               const Client* client, TraceWriter* trace, std::stop_token stop) {
  const auto file = formats::read_any_problem(path);
  if (!file) return tell_error(arguments, path, "", file.error(), false);
  if (!arguments.quiet && arguments.files.size() > 1) std::cerr << path << ":\n";
  const auto answer = answer_to(arguments, file->problem, options, client, trace, std::move(stop));
  if (!answer) return tell_error(arguments, path, file->problem.name, answer.error(), client != nullptr);
  const Subject subject = subject_of(path, *file);
  std::cout << (arguments.json() ? json_line(subject, *answer) + "\n" : summary(subject, *answer))
            << std::flush;
  return is_solved(answer->status) ? kAllSolved : kNotSolved;
}

int trace_fails(const Error& error) {
  std::cerr << "marble: " << error.message() << '\n';
  return kBadInput;
}

// Opened before anything is solved, so that a long solve is not lost for a path mistyped.
Expected<std::optional<TraceWriter>> open_trace(const SolveArguments& arguments) {
  if (arguments.trace.empty()) return std::nullopt;
  if (arguments.files.size() > 1) {
    return unexpected(invalid("--trace", "is the convergence of one problem: must go with one FILE, not " +
                                             std::to_string(arguments.files.size())));
  }
  auto writer = TraceWriter::open(arguments.trace);
  if (!writer) return unexpected(writer.error());
  return std::move(*writer);
}

int run(const SolveArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  std::optional<Client> client;
  if (!arguments.local && arguments.server.server != contract::local_address) {
    auto connected = connect(arguments.server);
    if (!connected) {
      std::cerr << "marble: " << connected.error().message() << '\n';
      return kBadInput;
    }
    client = std::move(*connected);
  }
  auto trace = open_trace(arguments);
  if (!trace) return trace_fails(trace.error());
  const Interrupt interrupt;
  int exit_code = kAllSolved;
  for (const std::string& path : arguments.files) {
    // One outcome a file, also after Ctrl-C: programs count the lines.
    const int outcome =
        interrupt.token().stop_requested()
            ? tell_error(arguments, path, "", failure(ErrorCode::cancelled, "not solved: interrupted before"),
                         false)
            : solve_file(arguments, path, *options, client ? &*client : nullptr, *trace ? &**trace : nullptr,
                         interrupt.token());
    exit_code = worse(exit_code, outcome);
  }
  if (*trace && (*trace)->rows() > 0) {  // else nothing was solved, as was told
    if (auto written = (*trace)->commit(); !written)
      exit_code = worse(exit_code, trace_fails(written.error()));
  }
  if (std::cout) return exit_code;
  std::cerr << "marble: standard output cannot be written\n";
  return worse(exit_code, kBadInput);
}

}  // namespace

void add_solve(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<SolveArguments>();
  CLI::App* command = program.add_subcommand("solve", "Solve problem files, in their order");
  command->add_option("FILE", arguments->files, ".json, .pb or .bin; - is standard input")->required();
  add_server_arguments(*command, arguments->server);
  add_priority_argument(*command, arguments->priority);
  command->add_flag("--local", arguments->local, "solve in this process, without a server")
      ->excludes(command->get_option("--server"));
  add_solver_arguments(*command, arguments->solver);
  command->add_option("--trace", arguments->trace,
                      "write every iteration to this file, as CSV; for one FILE (see: marble plot)");
  command->add_flag("--quiet", arguments->quiet, "no iteration table");
  command->footer(
      std::string("The iteration table goes to standard error, answers to standard output.\n"
                  "Ctrl-C stops the solve: a local one answers with its best iterate, a remote one is given "
                  "up.\n") +
      kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
