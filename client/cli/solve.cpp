#include <unistd.h>

#include <csignal>
#include <iostream>
#include <memory>
#include <thread>

#include "commands.h"
#include "exit_code.h"
#include "iteration_table.h"
#include "marble/client.h"
#include "marble/problem_file.h"
#include "marble/solver.h"
#include "report.h"

namespace marble::cli {
namespace {

struct SolveArguments {
  std::vector<std::string> files;
  std::string server;
  bool local = false;
  bool quiet = false;
  std::vector<std::string> options;
  double time_limit_s = 0.0;
  std::string output = "text";
  bool json() const { return output == "json"; }
};

// Ctrl-C asks the running solve to stop with its best iterate; a second one ends the program as usual.
class StopOnInterrupt {
 public:
  StopOnInterrupt() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGUSR2);  // ends the watch
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    watch_ = std::thread([this] {
      int signal = 0;
      sigwait(&signals_, &signal);
      if (signal != SIGINT) return;
      source_.request_stop();
      pthread_sigmask(SIG_UNBLOCK, &signals_, nullptr);
    });
  }
  ~StopOnInterrupt() {
    pthread_kill(watch_.native_handle(), SIGUSR2);
    watch_.join();
  }
  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }

 private:
  sigset_t signals_;
  std::stop_source source_;
  std::thread watch_;
};

Expected<Options> parse_options(const SolveArguments& arguments) {
  Options options;
  for (const std::string& option : arguments.options) {
    const std::size_t equals = option.find('=');
    if (equals == std::string::npos) {
      return unexpected(Error{ErrorCode::invalid_argument, "--option", -1, option, "must be name=value"});
    }
    if (auto set = set_option_text(options, option.substr(0, equals), option.substr(equals + 1)); !set) {
      return unexpected(set.error());
    }
  }
  if (arguments.time_limit_s > 0.0) {
    if (auto set = set_option(options, "time_limit_s", arguments.time_limit_s); !set)
      return unexpected(set.error());
  }
  return options;
}

Expected<Answer> solve_locally(const ProblemFile& file, const Options& options, ProgressSink* sink,
                               std::stop_token stop) {
  auto solution = marble::solve(file.problem.view(), options, {sink, stop, file.problem.initial_z});
  if (!solution) return unexpected(solution.error());
  return Answer{std::move(*solution), 0.0, ""};
}

Expected<Answer> solve_remotely(Client& client, const ProblemFile& file, const Options& options,
                                ProgressSink* sink, std::stop_token stop) {
  RemoteControls controls;
  controls.progress = sink;
  controls.stop = stop;
  controls.initial_z = file.problem.initial_z;
  controls.problem_name = file.problem.name.substr(0, 256);
  auto remote = client.solve(file.problem.view(), options, controls);
  if (!remote) return unexpected(remote.error());
  return Answer{std::move(remote->solution), remote->queue_s, std::move(remote->job_id)};
}

void tell_error(const SolveArguments& arguments, const std::string& file, const Error& error) {
  std::cerr << "marble: " << file << ": " << error.message() << '\n';
  if (arguments.json()) std::cout << json_line(file, error) << '\n' << std::flush;
}

int solve_file(const SolveArguments& arguments, const std::string& path, const Options& options,
               Client* client, std::stop_token stop) {
  auto file = read_problem(path);
  if (!file) {
    tell_error(arguments, path, file.error());
    return exit_code_of(file.error());
  }
  IterationTable table(colours_wanted());
  ProgressSink* sink = arguments.quiet ? nullptr : &table;
  auto answer = client == nullptr ? solve_locally(*file, options, sink, stop)
                                  : solve_remotely(*client, *file, options, sink, stop);
  if (!answer) {
    const Error& error = answer.error();
    const bool no_server = error.code == ErrorCode::unavailable;
    tell_error(arguments, no_server ? "server " + client->address() : path, error);
    return exit_code_of(error);
  }
  if (arguments.json()) {
    std::cout << json_line(path, *file, *answer) << '\n' << std::flush;
  } else {
    std::cout << summary(path, *file, *answer) << std::flush;
  }
  return is_solved(answer->solution.status) ? kAllSolved : kNotSolved;
}

int run(const SolveArguments& arguments) {
  const auto options = parse_options(arguments);
  if (!options) {
    std::cerr << "marble: " << options.error().message() << "  (marble options lists them all)\n";
    return kBadInput;
  }
  std::unique_ptr<Client> client;
  if (!arguments.local) {
    client = std::make_unique<Client>(arguments.server.empty() ? default_server_address() : arguments.server);
  }
  const StopOnInterrupt interrupt;
  int exit_code = kAllSolved;
  for (const std::string& path : arguments.files) {
    exit_code = worse(exit_code, solve_file(arguments, path, *options, client.get(), interrupt.token()));
    if (interrupt.token().stop_requested()) break;
  }
  return exit_code;
}

}  // namespace

void add_solve(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<SolveArguments>();
  CLI::App* command = program.add_subcommand("solve", "Solve problem files, in their order");
  command->add_option("FILE", arguments->files, ".json, .pb or .bin; - is standard input")->required();
  CLI::Option* server =
      command->add_option("--server", arguments->server, "address of the server: host:port or unix:PATH");
  command->add_flag("--local", arguments->local, "solve in this process, without a server")->excludes(server);
  command
      ->add_option("--option", arguments->options,
                   "a solver option, name=value; may be repeated (see: marble options)")
      ->allow_extra_args(false);
  command
      ->add_option("--time-limit", arguments->time_limit_s,
                   "seconds for each solve; the best iterate is returned")
      ->check(CLI::Range(1e-9, 1e9));
  command->add_option("--output", arguments->output, "text: a summary; json: one object a line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  command->add_flag("--quiet", arguments->quiet, "no iteration table");
  command->footer(
      "The iteration table goes to standard error, answers to standard output.\n"
      "Exit codes: 0 all solved, 1 some not solved, 2 usage or bad file, 3 server unreachable or refused.");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
