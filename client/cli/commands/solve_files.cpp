#include "commands/solve_files.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iostream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/atomic_file.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "marble/json_proof.h"
#include "marble/sensitivity.h"
#include "marble/solver.h"
#include "output/conflict_text.h"
#include "output/iteration_table.h"
#include "output/json.h"
#include "output/trace_file.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

// Reads a request for derivatives of a solution from a file.

using Numbers = std::vector<double>;

// The destination of one part's numbers, and their count per direction or loss.
struct Place {
  std::string_view name;
  Numbers* all;
  std::size_t size;
};

Expected<Numbers> take_numbers(const Json& json, const std::string& field, std::size_t size) {
  if (!json.is_array()) return unexpected(invalid(field, "must be a list of numbers"));
  if (json.size() != size) {
    return unexpected(invalid(field, std::to_string(json.size()) + " entries",
                              "must have " + std::to_string(size) + " entries"));
  }
  Numbers numbers;
  for (const Json& number : json) {
    if (!number.is_number()) {
      return unexpected(
          invalid(field, static_cast<std::int64_t>(numbers.size()), number.dump(), "must be a number"));
    }
    numbers.push_back(number.get<double>());
  }
  return numbers;
}

// Reads a list of directions or losses: for each its parts, one after the other, with zeros for the others.
Expected<Index> take_list(const Json& json, const std::string& field, std::span<const Place> places) {
  if (!json.contains(field)) return 0;
  const Json& list = json[field];
  if (!list.is_array()) return unexpected(invalid(field, "must be a list of objects"));
  for (std::size_t k = 0; k < list.size(); ++k) {
    const std::string at = field + "[" + std::to_string(k) + "]";
    if (!list[k].is_object()) return unexpected(invalid(at, "must be an object of lists of numbers"));
    for (const auto& [name, values] : list[k].items()) {
      const auto place = std::ranges::find(places, name, &Place::name);
      if (place == places.end()) return unexpected(invalid(at + "." + name, "is no part of it"));
      MARBLE_ASSIGN_OR_RETURN(auto numbers, take_numbers(values, at + "." + name, place->size));
      place->all->resize(list.size() * place->size);
      std::ranges::copy(numbers, place->all->begin() + static_cast<std::ptrdiff_t>(k * place->size));
    }
  }
  return static_cast<Index>(list.size());
}

Expected<SparseMatrix> take_rows(const Json& json, std::size_t variables) {
  if (!json.is_array() || json.empty())
    return unexpected(invalid("rows.E", "must be a list of rows of numbers"));
  Triplets entries;
  for (std::size_t i = 0; i < json.size(); ++i) {
    MARBLE_ASSIGN_OR_RETURN(const auto row,
                            take_numbers(json[i], "rows.E[" + std::to_string(i) + "]", variables));
    for (std::size_t j = 0; j < row.size(); ++j) {
      if (row[j] != 0.0) entries.add(static_cast<Index>(i), static_cast<Index>(j), row[j]);
    }
  }
  return compress(static_cast<Index>(json.size()), static_cast<Index>(variables), entries, "rows.E");
}

Expected<void> take(const Json& json, const OwnedProblem& problem, OwnedSensitivityRequest& request) {
  if (!json.is_object()) return unexpected(invalid("", "must be an object"));
  for (const auto& [name, part] : json.items()) {
    if (name != "directions" && name != "losses" && name != "rows")
      return unexpected(invalid(name, "must be directions, losses or rows"));
  }
  std::vector<Place> places;
#define MARBLE_VECTOR(letter, field) \
  places.push_back({#letter, &request.numbers.letter, problem.letter.size()});
#define MARBLE_MATRIX(letter, field, update, vector) \
  places.push_back({#letter, &request.numbers.letter.values, problem.letter.values.size()});
#include "marble/contract.def"
  MARBLE_ASSIGN_OR_RETURN(request.directions, take_list(json, "directions", places));
  const Place of_answer[] = {
      {"z", &request.z, problem.g.size()},
      {"equality_multipliers", &request.equality_multipliers, problem.b.size()},
      {"inequality_multipliers", &request.inequality_multipliers, problem.d.size()},
      {"complementarity_multipliers_L", &request.complementarity_multipliers_L, problem.l.size()},
      {"complementarity_multipliers_R", &request.complementarity_multipliers_R, problem.r.size()}};
  MARBLE_ASSIGN_OR_RETURN(request.losses, take_list(json, "losses", of_answer));
  if (!json.contains("rows")) return {};
  const Json& rows = json["rows"];
  if (!rows.is_object()) return unexpected(invalid("rows", "must be an object with E"));
  MARBLE_ASSIGN_OR_RETURN(request.E, take_rows(rows.value("E", Json()), problem.g.size()));
  for (const auto& [name, part] : rows.items()) {
    Numbers* const vector = name == "proximal" ? &request.proximal : name == "g" ? &request.g : nullptr;
    if (vector != nullptr) {
      MARBLE_ASSIGN_OR_RETURN(*vector, take_numbers(part, "rows." + name, problem.g.size()));
    } else if (name == "columns" && part.is_boolean()) {
      request.columns = part.get<bool>();
    } else if (name != "E") {
      return unexpected(invalid("rows." + name, "must be E, proximal, g or columns, which is true or false"));
    }
  }
  return {};
}

// Parses the file. Errors: not_found, invalid_argument of field "--sensitivity".
Expected<Json> read_sensitivity(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return unexpected(
        failure(ErrorCode::not_found, "--sensitivity", path, "must be a file that can be read"));
  const std::string text(std::istreambuf_iterator<char>(file), {});
  Json json = parsed(text);
  if (json.is_discarded())
    return unexpected(
        invalid("--sensitivity", path,
                "must be a file of JSON, nested at most " + std::to_string(kDeepestJson) + " deep"));
  return json;
}

// Returns the request for a problem. Errors: invalid_argument, of fields such as
// "sensitivity.directions[0].b".
Expected<OwnedSensitivityRequest> sensitivity_of(const Json& json, const OwnedProblem& problem) {
  OwnedSensitivityRequest request;
  if (auto taken = take(json, problem, request); !taken) {
    Error error = taken.error();
    error.field = error.field.empty() ? "sensitivity" : "sensitivity." + error.field;
    return unexpected(std::move(error));
  }
  return request;
}

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
  MARBLE_ASSIGN_OR_RETURN(auto file, AtomicFile::open(arguments.proof));
  return std::optional<AtomicFile>(std::move(file));
}

// Opens the trace before anything is solved, so that a mistyped path does not waste a long solve.
Expected<std::optional<TraceWriter>> open_trace(const SolveArguments& arguments) {
  if (arguments.trace.empty()) return std::nullopt;
  if (arguments.files.size() > 1) {
    return unexpected(invalid("--trace", "is the convergence of one problem: must go with one FILE, not " +
                                             std::to_string(arguments.files.size())));
  }
  MARBLE_ASSIGN_OR_RETURN(auto writer, TraceWriter::open(arguments.trace));
  return writer;
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
  MARBLE_ASSIGN_OR_RETURN(auto solution, solve_in_process(problem.view(), options, controls));
  Answer answer;
  static_cast<Solution&>(answer) = std::move(solution);
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
