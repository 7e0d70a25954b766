#include <chrono>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include "ampl/nonlinear.h"
#include "arguments/solve_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "commands/solve_files.h"
#include "file_bytes.h"
#include "formats.h"
#include "marble/client.h"
#include "marble/convert.h"
#include "marble/solver.h"
#include "marble/v1/service.pb.h"
#include "output/iteration_table.h"
#include "output/problem_names.h"
#include "plain_text.h"
#include "replay/bundle_file.h"

namespace marble::cli {
namespace {

std::string about(double wait_s) {
  char text[48] = "";
  if (wait_s > 0.0) std::snprintf(text, sizeof text, ", about %.1f s", wait_s);
  return text;
}

// Prints the position in the queue for a waiting person.
void report_place(CallControls& call) {
  const auto job = std::make_shared<std::string>();
  call.accepted = [job](const std::string& job_id, int position, double wait_s) {
    *job = without_controls(job_id);
    if (position > 0)
      std::fprintf(stderr, "job %s waits behind %d%s\n", job->c_str(), position, about(wait_s).c_str());
  };
  call.moved = [job](int position, double wait_s) {
    if (position > 0) {
      std::fprintf(stderr, "job %s waits behind %d%s\n", job->c_str(), position, about(wait_s).c_str());
    } else {
      std::fprintf(stderr, "job %s is next%s\n", job->c_str(), about(wait_s).c_str());
    }
  };
}

Expected<Answer> solve_remotely(const SolveArguments& arguments, const Client& client,
                                const OwnedProblem& problem, const Options& options,
                                const SolveControls& controls) {
  CallControls call;
  call.problem_name = problem.name;
  call.priority = arguments.priority;
  if (!arguments.quiet) report_place(call);
  auto answer = client.solve(problem.view(), options, controls, call);
  if (answer && answer->progress_skipped > 0) {
    std::fprintf(stderr, "(%lld more iterations; the connection was slower than the solver)\n",
                 static_cast<long long>(answer->progress_skipped));
  }
  if (!answer && answer.error().code == ErrorCode::unavailable)
    answer.error().bound = "server " + client.address() + ": " + answer.error().bound;
  return answer;
}

// Forwards rows to another sink, and keeps them.
class KeptRows final : public ProgressSink {
 public:
  KeptRows(ProgressSink* next, v1::Trace* trace) : next_(next), trace_(trace) { trace_->set_stride(1); }
  void report(const Progress& row) override {
    to_message(without_vectors(row), trace_->add_rows());
    if (next_ != nullptr) next_->report(row);
  }

 private:
  ProgressSink* const next_;
  v1::Trace* const trace_;
};

using Solve = std::function<Expected<Answer>(const OwnedProblem&, const Options&, const SolveControls&)>;

// Solves, and writes a bundle of the solve whatever its result.
Solve with_bundle(const SolveArguments& arguments, const Client* server, Solve solve) {
  return [&arguments, server, solve = std::move(solve)](const OwnedProblem& problem, const Options& options,
                                                        const SolveControls& given) -> Expected<Answer> {
    Bundle bundle;
    report_build(&bundle.facts);
    if (server != nullptr) {  // the server is another process, perhaps on another machine
      const auto info = server->info();
      bundle.facts.set_version(info ? info->version : "unknown");
      bundle.facts.set_build("a server's build");
      bundle.facts.set_cpu("a server's processor");
    }
    v1::SolveRequest request;
    to_message(problem.view(), request.mutable_problem());
    request.mutable_problem()->set_name(problem.name);
    to_message(options, request.mutable_options());
    request.mutable_initial_point()->mutable_z()->Assign(given.initial_z.begin(), given.initial_z.end());
    if (given.sensitivity != nullptr) to_message(*given.sensitivity, request.mutable_sensitivity());
    v1::GetJobResponse* job = bundle.facts.mutable_job();
    to_message(options, job->mutable_options());
    const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
    job->mutable_job()->set_accepted_unix_s(now.count());
    KeptRows rows(given.progress, job->mutable_trace());
    SolveControls controls = given;
    controls.progress = &rows;
    auto answer = solve(problem, options, controls);
    v1::SolveResponse response;
    if (answer) {
      if (answer->progress_skipped > 0) job->clear_trace();  // with gaps the positions of rows are unknown
      to_message(*answer, response.mutable_solution());
      to_message(options, response.mutable_solution()->mutable_options());
      response.SerializeToString(&bundle.answer);
    } else {
      job->mutable_job()->mutable_error()->set_code(to_message(answer.error().code));
      job->mutable_job()->mutable_error()->set_message(answer.error().message());
    }
    job->mutable_job()->set_state(v1::JOB_STATE_FINISHED);
    request.SerializeToString(&bundle.request);
    bundle.facts.set_request_bytes(static_cast<std::int64_t>(bundle.request.size()));
    bundle.facts.set_answer_bytes(static_cast<std::int64_t>(bundle.answer.size()));
    if (const auto saved = save_bundle(bundle, arguments.bundle); !saved && answer)
      return unexpected(saved.error());
    return answer;
  };
}

// The words for nonlinear files only are not options of the solver.
Expected<Options> options_of_lcqps(SolverArguments arguments) {
  std::erase_if(arguments.options, [](const std::string& word) {
    return word.find('=') != std::string::npos && is_nonlinear_word(word.substr(0, word.find('=')));
  });
  return parse_options(arguments);
}

Expected<nonlinear::Settings> nonlinear_settings(const SolverArguments& arguments) {
  nonlinear::Settings settings;
  std::vector<std::string> words = arguments.options;
  if (!arguments.time_limit_s.empty()) words.push_back("time_limit_s=" + arguments.time_limit_s);
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    MARBLE_RETURN_IF_ERROR(set_nonlinear_text(settings, word.substr(0, equals), word.substr(equals + 1)));
  }
  return settings;
}

// Solves an .nl file that is not an LCQP; returns nothing for any other file.
std::optional<int> solve_nonlinear_file(const SolveArguments& arguments, nonlinear::Settings settings,
                                        const std::string& path, std::stop_token stop) {
  if (!path.ends_with(".nl")) return std::nullopt;
  const auto content = formats::read_bytes(path);
  if (!content) return std::nullopt;
  const std::string stub = path.substr(0, path.size() - 3), name = stub.substr(stub.find_last_of('/') + 1);
  const auto nl = or_out_of_memory(
      [&] { return formats::parse_nonlinear_nl(*content, name, formats::NlNames::beside(stub)); });
  if (!nl) return report_error(arguments, path, "", nl.error(), false);
  if (arguments.explains) {
    return report_error(arguments, path, name,
                        invalid("FILE", path, "must be an LCQP: this problem is nonlinear"), false);
  }
  if (!arguments.trace.empty()) {
    return report_error(arguments, path, name,
                        invalid("--trace", "is the convergence of an LCQP: this problem is nonlinear"),
                        false);
  }
  if (!arguments.bundle.empty()) {
    return report_error(arguments, path, name,
                        invalid("--bundle", "is of an LCQP: this problem is nonlinear"), false);
  }
  if (!arguments.proof.empty()) {
    return report_error(arguments, path, name, invalid("--proof", "is of an LCQP: this problem is nonlinear"),
                        false);
  }
  if (!arguments.sensitivity.empty()) {
    return report_error(arguments, path, name,
                        invalid("--sensitivity", "is of an LCQP's answer: this problem is nonlinear"), false);
  }
  if (!arguments.quiet && arguments.files.size() > 1) std::cerr << without_controls(path) << ":\n";
  NonlinearTable table(nl->sign(), colours_wanted(), stderr);
  if (!arguments.quiet) settings.iteration = [&table](const nonlinear::Iteration& row) { table.report(row); };
  settings.stop = std::move(stop);
  const bool here = arguments.here();
  const auto begun = std::chrono::steady_clock::now();
  const auto answer = solve_nonlinear(*nl, settings, here ? nullptr : &arguments.server);
  if (!answer) return report_error(arguments, path, name, answer.error(), !here);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  std::cout << (arguments.json() ? json_line(path, *nl, *answer, seconds) + "\n"
                                 : summary(*nl, *answer, seconds))
            << std::flush;
  return is_solved(answer->status) ? kAllSolved : kNotSolved;
}

int run(const SolveArguments& arguments) {
  auto options = options_of_lcqps(arguments.solver);
  if (!options) return option_fails(options.error());
  if (arguments.explains) options->explain = true;
  const auto nonlinear = nonlinear_settings(arguments.solver);
  if (!nonlinear) return option_fails(nonlinear.error());
  if (!arguments.bundle.empty() && arguments.files.size() > 1) {
    return option_fails(invalid("--bundle", "is one problem's: must go with one FILE, not " +
                                                std::to_string(arguments.files.size())));
  }
  const auto solve = [&](const Client* server, Solve how) {
    return arguments.bundle.empty() ? how : with_bundle(arguments, server, std::move(how));
  };
  SolveMeans means{formats::read_any_problem, solve(nullptr, solve_locally)};
  std::optional<ProblemNames> of_input;  // standard input is read once, with its names
  if (options->explain) {
    means.read = [&of_input](const std::string& path) -> Expected<ProblemFile> {
      if (path != "-") return formats::read_any_problem(path);
      MARBLE_ASSIGN_OR_RETURN(auto named, read_named_problem(path));
      of_input = std::move(named.names);
      return std::move(named.file);
    };
  }
  means.names = [&of_input](const std::string& path, const OwnedProblem& problem) {
    return path == "-" && of_input ? Expected<ProblemNames>(*of_input) : names_of_file(path, problem);
  };
  means.otherwise = [&](const std::string& path, std::stop_token stop) {
    return solve_nonlinear_file(arguments, *nonlinear, path, std::move(stop));
  };
  if (arguments.here()) return solve_files(arguments, *options, means);
  const auto client = connect(arguments.server);
  if (!client) {
    complain(client.error().message());
    return kBadInput;
  }
  means.solve =
      solve(&*client, [&](const OwnedProblem& problem, const Options& own, const SolveControls& controls) {
        return solve_remotely(arguments, *client, problem, own, controls);
      });
  means.remote = true;
  return solve_files(arguments, *options, means);
}

}  // namespace

void add_solve(CLI::App& program, int& exit_code) {
  const auto arguments = std::make_shared<SolveArguments>();
  add_solve_command(program, arguments)->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

void add_explain(CLI::App& program, int& exit_code) {
  const auto arguments = std::make_shared<SolveArguments>();
  add_explain_command(program, arguments)->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
