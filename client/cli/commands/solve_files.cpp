#include "commands/solve_files.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <optional>

#include "arguments/sensitivity_file.h"
#include "base/atomic_file.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "marble/json_proof.h"
#include "marble/solver.h"
#include "output/conflict_text.h"
#include "output/iteration_table.h"
#include "output/trace_file.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

// Forwards each iteration to the terminal, the trace, both or neither.
class Listeners final : public ProgressSink {
 public:
  Listeners(bool reports, TraceWriter* trace) : table_(colours_wanted()), reports_(reports), trace_(trace) {}
  void report(const Progress& progress) override {
    if (reports_) table_.report(progress);
    if (trace_ != nullptr) trace_->report(progress);
  }
  [[nodiscard]] ProgressSink* sink() { return reports_ || trace_ != nullptr ? this : nullptr; }
  [[nodiscard]] IterationTable& table() { return table_; }

 private:
  IterationTable table_;
  bool reports_;
  TraceWriter* trace_;
};

// Removes the file if nothing was proved.
Expected<void> save_proof(AtomicFile& file, const Proof& proof, const OwnedProblem& problem,
                          const Options& options, const Solution& solution) {
  if (proof.claim == Proof::Claim::none)
    return unexpected(failure(ErrorCode::failed_precondition, "no proof was written: " + proof.reason));
  write_proof(proof, problem.view(), options, solution, [&file](std::string_view text) { file.write(text); });
  return file.commit();
}

// Replaces the objective by the distance to 0: any would do, and proofs succeed more often for a convex
// problem.
void leave_objective_out(OwnedProblem& p) {
  const auto n = static_cast<Index>(p.g.size());
  Triplets diagonal;
  for (Index j = 0; j < n; ++j) diagonal.add(j, j, 1.0);
  p.Q = compress(n, n, diagonal, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  std::ranges::fill(p.g, 0.0);
  p.c0 = 0.0;
}

int solve_file(const SolveArguments& arguments, const std::string& path, const Options& options,
               const SolveMeans& means, TraceWriter* trace, AtomicFile* proof_file, const Json& sensitivity,
               std::stop_token stop) {
  auto file = means.read(path);
  if (!file) {
    if (means.otherwise) {
      if (const auto outcome = means.otherwise(path, stop)) return *outcome;
    }
    return report_error(arguments, path, "", file.error(), false);
  }
  if (arguments.explains) leave_objective_out(file->problem);
  if (!arguments.quiet && arguments.files.size() > 1) std::cerr << without_controls(path) << ":\n";
  Listeners listeners(!arguments.quiet, trace);
  listeners.table().set_maximize(file->maximize);
  std::optional<ActivityDisplay> display;
  if (!arguments.quiet) display.emplace(listeners.table());
  SolveControls controls{.progress = listeners.sink(),
                         .stop = std::move(stop),
                         .initial_z = file->problem.initial_z,
                         .activity = display ? display->monitor() : nullptr};
  std::optional<ProblemNames> names;  // read before a solve that may take long, because they may be invalid
  if (options.explain && means.names) {
    auto read = means.names(path, file->problem);
    if (!read) return report_error(arguments, path, file->problem.name, read.error(), false);
    names = std::move(*read);
  }
  Expected<OwnedSensitivityRequest> asked;
  SensitivityRequest request;
  if (!sensitivity.is_null()) {
    asked = sensitivity_of(sensitivity, file->problem);
    if (!asked) return report_error(arguments, path, file->problem.name, asked.error(), false);
    request = asked->view();
    controls.sensitivity = &request;
  }
  Proof proof;
  if (proof_file != nullptr) controls.proof = &proof;
  const auto answer = means.solve(file->problem, options, controls);
  display.reset();
  if (!answer) return report_error(arguments, path, file->problem.name, answer.error(), means.remote);
  Subject subject = subject_of(path, *file, options);
  if (answer->conflict) {
    subject.conflict = conflict_lines(file->problem, names ? *names : ProblemNames{}, *answer->conflict,
                                      answer->certificate);
  }
  std::cout << (arguments.json()     ? json_line(subject, *answer) + "\n"
                : arguments.explains ? explanation(subject, *answer)
                                     : summary(subject, *answer))
            << std::flush;
  const bool succeeded = arguments.explains ? answer->conflict.has_value() : is_solved(answer->status);
  const int outcome = succeeded ? kAllSolved : kNotSolved;
  if (proof_file == nullptr) return outcome;
  const auto saved = save_proof(*proof_file, proof, file->problem, options, *answer);
  if (!saved) complain(saved.error().message());
  return saved ? outcome : worse(outcome, kNotSolved);
}

int argument_fails(const Error& error) {
  complain(error.message());
  return kBadInput;
}

// Opens the proof of one problem, solved in this process: a server's response has no field for it.
Expected<std::optional<AtomicFile>> open_proof(const SolveArguments& arguments) {
  if (arguments.proof.empty()) return std::nullopt;
  if (arguments.files.size() > 1) {
    return unexpected(invalid(
        "--proof", "is one problem's: must go with one FILE, not " + std::to_string(arguments.files.size())));
  }
  if (!arguments.here()) return unexpected(invalid("--proof", "a server sends none: must go with --local"));
  auto file = AtomicFile::open(arguments.proof);
  if (!file) return unexpected(file.error());
  return std::optional<AtomicFile>(std::move(*file));
}

// Opens the trace before anything is solved, so that a mistyped path does not waste a long solve.
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

}  // namespace

int report_error(const SolveArguments& arguments, const std::string& file, const std::string& name,
                 const Error& error, bool remote) {
  complain(file, error.message());
  if (arguments.json()) std::cout << json_line(file, name, error) << '\n' << std::flush;
  return remote ? exit_code_of(error) : exit_code_of_local(error);
}

Expected<Answer> solve_locally(const OwnedProblem& problem, const Options& options,
                               const SolveControls& controls) {
  const auto begun = std::chrono::steady_clock::now();
  auto solution = solve_in_process(problem.view(), options, controls);
  if (!solution) return unexpected(std::move(solution.error()));
  Answer answer;
  static_cast<Solution&>(answer) = std::move(*solution);
  answer.total_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return answer;
}

int solve_files(const SolveArguments& arguments, const Options& options, const SolveMeans& means) {
  auto trace = open_trace(arguments);
  if (!trace) return argument_fails(trace.error());
  const auto sensitivity =
      arguments.sensitivity.empty() ? Expected<Json>() : read_sensitivity(arguments.sensitivity);
  if (!sensitivity) return argument_fails(sensitivity.error());
  auto proof = open_proof(arguments);
  if (!proof) return argument_fails(proof.error());
  warn_of_idle_options(arguments.solver, options);
  const Interrupt interrupt;
  int exit_code = kAllSolved;
  for (const std::string& path : arguments.files) {
    // One result per file, also after Ctrl-C: programs count the lines.
    const int outcome =
        interrupt.token().stop_requested()
            ? report_error(arguments, path, "",
                           failure(ErrorCode::cancelled, "not solved: interrupted before"), false)
            : solve_file(arguments, path, options, means, *trace ? &**trace : nullptr,
                         *proof ? &**proof : nullptr, *sensitivity, interrupt.token());
    exit_code = worse(exit_code, outcome);
  }
  if (*trace && (*trace)->rows() > 0) {  // else nothing was solved, as was reported
    if (auto written = (*trace)->commit(); !written)
      exit_code = worse(exit_code, argument_fails(written.error()));
  }
  if (std::cout) return exit_code;
  complain("standard output cannot be written");
  return worse(exit_code, kBadInput);
}

}  // namespace marble::cli
