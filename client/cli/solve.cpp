#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include "commands.h"
#include "exit_code.h"
#include "interrupt.h"
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
  std::string time_limit_s;
  std::string output = "text";
  [[nodiscard]] bool json() const { return output == "json"; }
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
  if (!arguments.time_limit_s.empty()) {
    auto set = set_option_text(options, "time_limit_s", arguments.time_limit_s);
    if (!set) {
      set.error().field = "--time-limit";
      return unexpected(set.error());
    }
  }
  return options;
}

// Where the solving is done: on a server, or here if there is no client.
class Engine {
 public:
  Engine(std::optional<Client> client, bool tells_progress)
      : client_(std::move(client)), tells_progress_(tells_progress) {}

  [[nodiscard]] Expected<Answer> solve(const ProblemFile& file, const Options& options,
                                       std::stop_token stop) const {
    IterationTable table(colours_wanted());
    const SolveControls controls{tells_progress_ ? &table : nullptr, std::move(stop), file.problem.initial_z};
    return client_ ? remote(file.problem, options, controls) : local(file.problem, options, controls);
  }

 private:
  [[nodiscard]] static Expected<Answer> local(const OwnedProblem& problem, const Options& options,
                                              const SolveControls& controls) {
    auto solution = marble::solve(problem.view(), options, controls);
    if (!solution) return unexpected(solution.error());
    return Answer{std::move(*solution), "", 0.0, 0.0, 0};
  }

  [[nodiscard]] Expected<Answer> remote(const OwnedProblem& problem, const Options& options,
                                        const SolveControls& controls) const {
    CallControls call;
    call.problem_name = problem.name;
    if (tells_progress_) {
      call.accepted = [](const std::string& job_id, int position, double) {
        if (position > 0) std::fprintf(stderr, "job %s waits behind %d\n", job_id.c_str(), position);
      };
    }
    auto answer = client_->solve(problem.view(), options, controls, call);
    if (answer && answer->progress_skipped > 0) {
      std::fprintf(stderr, "(%lld more iterations; the connection was slower than the solver)\n",
                   static_cast<long long>(answer->progress_skipped));
    }
    if (!answer && answer.error().code == ErrorCode::unavailable)
      answer.error().bound = "server " + client_->address() + ": " + answer.error().bound;
    return answer;
  }

  std::optional<Client> client_;
  bool tells_progress_;
};

int tell_error(const SolveArguments& arguments, const std::string& file, const std::string& name,
               const Error& error) {
  std::cerr << "marble: " << file << ": " << error.message() << '\n';
  if (arguments.json()) std::cout << json_line(file, name, error) << '\n' << std::flush;
  return exit_code_of(error);
}

int solve_file(const SolveArguments& arguments, const std::string& path, const Options& options,
               const Engine& engine, std::stop_token stop) {
  const auto file = read_problem(path);
  if (!file) return tell_error(arguments, path, "", file.error());
  if (!arguments.quiet && arguments.files.size() > 1) std::cerr << path << ":\n";
  const auto answer = engine.solve(*file, options, std::move(stop));
  if (!answer) return tell_error(arguments, path, file->problem.name, answer.error());
  std::cout << (arguments.json() ? json_line(path, *file, *answer) + "\n" : summary(*file, *answer))
            << std::flush;
  return is_solved(answer->status) ? kAllSolved : kNotSolved;
}

int usage_error(const Error& error, const char* hint) {
  std::cerr << "marble: " << error.message() << hint << '\n';
  return kBadInput;
}

int run(const SolveArguments& arguments) {
  const auto options = parse_options(arguments);
  if (!options) return usage_error(options.error(), "  (marble options lists them all)");
  std::optional<Client> client;
  if (!arguments.local) {
    auto connected = Client::connect(arguments.server.empty() ? default_server_address() : arguments.server);
    if (!connected) return usage_error(connected.error(), "");
    client = std::move(*connected);
  }
  const Engine engine(std::move(client), !arguments.quiet);
  const Interrupt interrupt;
  int exit_code = kAllSolved;
  for (const std::string& path : arguments.files) {
    // One outcome a file, also after Ctrl-C: programs count the lines.
    const int outcome = interrupt.token().stop_requested()
                            ? tell_error(arguments, path, "",
                                         {ErrorCode::cancelled, "", -1, "", "not solved: interrupted before"})
                            : solve_file(arguments, path, *options, engine, interrupt.token());
    exit_code = worse(exit_code, outcome);
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
  CLI::Option* server = command->add_option(
      "--server", arguments->server,
      "address of the server: host:port or unix:PATH; default MARBLE_SERVER, else 127.0.0.1:50051");
  command->add_flag("--local", arguments->local, "solve in this process, without a server")->excludes(server);
  command
      ->add_option("--option", arguments->options,
                   "a solver option, name=value; may be repeated (see: marble options)")
      ->allow_extra_args(false);
  command->add_option("--time-limit", arguments->time_limit_s,
                      "seconds for each solve; the best iterate is returned");
  command->add_option("--output", arguments->output, "text: a summary; json: one object a line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  command->add_flag("--quiet", arguments->quiet, "no iteration table");
  command->footer(
      std::string("The iteration table goes to standard error, answers to standard output.\n"
                  "Ctrl-C stops the solve: a local one answers with its best iterate, a remote one is given "
                  "up.\n") +
      kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
