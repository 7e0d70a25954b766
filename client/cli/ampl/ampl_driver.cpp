#include "ampl/ampl_driver.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <iterator>

#include "ampl/ampl_command_line.h"
#include "ampl/nonlinear.h"
#include "arguments/server_arguments.h"
#include "base/atomic_file.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "file_bytes.h"
#include "marble/client.h"
#include "marble/contract.h"
#include "marble/report/solution_kind.h"
#include "marble/solver.h"
#include "marble/version.h"
#include "nl/nl_answer.h"
#include "nl/nl_nonlinear.h"
#include "nl/nl_problem.h"
#include "nl/nl_tokens.h"
#include "nl/sol_file.h"
#include "output/iteration_table.h"
#include "output/proof.h"
#include "output/text_table.h"
#include "plain_text.h"

namespace marble::cli::ampl {
namespace {

using formats::MultiplierView;
using formats::NlNonlinear;
using formats::NlProblem;
using formats::SolFile;
using formats::SolSuffix;

// solve_result_num in AMPL's ranges: 0 solved, 100 solved?, 200 infeasible, 300 unbounded, 400 limit, 500
// failure.
enum Code {
  kNotTaken = 510,  // an invalid file, or an invalid request
  kWrongOption = 520,
  kNoAnswer = 530,  // from a server
};

int code_of(Status status) {
  switch (status) {
    case Status::solved:
      return 0;
    case Status::almost_solved:
      return 100;
    case Status::infeasible:
      return 200;
    case Status::locally_infeasible:
      return 201;
    case Status::unbounded:
      return 300;
    case Status::iteration_limit:
      return 400;
    case Status::time_limit:
      return 401;
    case Status::cancelled:
      return 402;
    case Status::numerical_failure:
      break;
  }
  return 500;
}

std::string banner() { return std::string("marble ") + kVersion + ": "; }

std::string message_of(const Solution& s, double sign) {
  std::string text = banner() + to_string(s.status);
  if (is_solved(s.status)) text += "; objective " + formatted("%.10g", sign * s.objective + 0.0);
  text += "\n" + std::to_string(s.iterations) + " iterations, " + std::to_string(s.factorizations) +
          " factorizations";
  Proof tree = proof_of(s);
  tree.bound = sign * tree.bound;
  SolutionFacts facts = facts_of(s, Options());
  facts.maximize = sign < 0.0;
  const bool no_gap = is_solved(s.status) && !std::isfinite(s.gap);
  if (const std::string how = no_gap ? kind_text(facts) : proof_text(tree); !how.empty()) text += "\n" + how;
  if (!is_solved(s.status)) text += "\n" + without_controls(s.detail) + "\n" + advice(s.status);
  return text;
}

SolSuffix suffix(const char* name, SolSuffix::Of of, const std::vector<double>& values) {
  SolSuffix result{name, of, {}};
  for (std::size_t i = 0; i < values.size(); ++i)
    result.values.emplace_back(static_cast<Index>(i), values[i]);
  return result;
}

// Adds proofs that there is no solution, or bounds on the objective: dunbdd and unbdd are AMPL's names for
// rays.
void add_proofs(const NlProblem& nl, const Solution& s, SolFile& sol) {
  using Of = SolSuffix::Of;
  const auto variables = static_cast<std::size_t>(sol.variables);
  if (s.status == Status::infeasible && !s.certificate.empty()) {
    const auto proof = MultiplierView::stacked(nl.file.problem, s.certificate);
    sol.suffixes.push_back(
        suffix("dunbdd", Of::constraints,
               formats::sums(nl.row_duals, static_cast<std::size_t>(sol.constraints), proof)));
  }
  if (s.status == Status::unbounded && s.certificate.size() >= variables) {
    sol.suffixes.push_back(
        suffix("unbdd", Of::variables, {s.certificate.begin(), s.certificate.begin() + sol.variables}));
  }
  if (std::isfinite(s.bound)) sol.suffixes.push_back({"bound", Of::problem, {{0, nl.sign() * s.bound}}});
  if (std::isfinite(s.gap)) sol.suffixes.push_back({"gap", Of::problem, {{0, s.gap}}});
}

void add_answer(const NlProblem& nl, const Solution& s, SolFile& sol) {
  const auto multipliers = MultiplierView::of(s);
  sol.message = message_of(s, nl.sign());
  sol.code = code_of(s.status);
  sol.primals.assign(s.z.begin(), s.z.begin() + sol.variables);
  sol.duals = formats::sums(nl.row_duals, static_cast<std::size_t>(sol.constraints), multipliers, nl.sign());
  if (is_solved(s.status)) {
    const auto add = [&](const char* name, auto&& wanted) {
      std::vector<formats::DualTerm> terms;
      std::ranges::copy_if(nl.reduced_costs, std::back_inserter(terms), wanted);
      sol.suffixes.push_back(
          suffix(name, SolSuffix::Of::variables,
                 formats::sums(terms, static_cast<std::size_t>(sol.variables), multipliers, nl.sign())));
    };
    add("rc", [](const formats::DualTerm&) { return true; });
    // The names that JuMP reads (MathOptInterface, FileFormats.NL).
    add("lower_bound_duals", [](const formats::DualTerm& term) { return term.sign > 0.0; });
    add("upper_bound_duals", [](const formats::DualTerm& term) { return term.sign < 0.0; });
  }
  add_proofs(nl, s, sol);
}

void add_answer(const NlNonlinear& nl, const nonlinear::Answer& a, SolFile& sol) {
  sol.message = banner() + to_string(a.status);
  if (is_solved(a.status)) sol.message += "; objective " + formatted("%.10g", nl.sign() * a.objective + 0.0);
  sol.message += "\n" + std::to_string(a.iterations) + " iterations, " + std::to_string(a.ticks) +
                 " LCQPs, " + std::to_string(a.factorizations) + " factorizations";
  if (!is_solved(a.status)) sol.message += "\n" + without_controls(a.detail) + "\n" + advice(a.status);
  sol.code = code_of(a.status);
  NonlinearVectors vectors = NonlinearVectors::of(nl, a);
  sol.primals = std::move(vectors.x), sol.duals = std::move(vectors.duals);
  if (!is_solved(a.status)) return;
  const auto of = SolSuffix::Of::variables;
  sol.suffixes = {suffix("rc", of, vectors.reduced_costs),
                  suffix("lower_bound_duals", of, vectors.lower_bound_duals),
                  suffix("upper_bound_duals", of, vectors.upper_bound_duals)};
}

bool is_here(const Settings& settings) {
  return settings.server.empty() || settings.server == contract::local_address;
}

Expected<Solution> solve(const NlProblem& nl, const Settings& settings, std::stop_token stop) {
  const OwnedProblem& problem = nl.file.problem;
  IterationTable table(false, stdout);
  table.set_maximize(nl.file.maximize);
  SolveControls controls{settings.reports ? &table : nullptr, std::move(stop), problem.initial_z};
  const bool has_duals = std::ranges::any_of(nl.initial_duals, [](double dual) { return dual != 0.0; });
  std::optional<Solution> start;
  if (has_duals && !problem.initial_z.empty()) controls.warm_start = &start.emplace(initial_answer(nl));
  if (is_here(settings)) return solve_in_process(problem.view(), settings.options, controls);
  ServerArguments arguments;
  arguments.server = settings.server;
  MARBLE_ASSIGN_OR_RETURN(const auto client, connect(arguments));
  auto answer = client.solve(problem.view(), settings.options, controls, {.problem_name = problem.name});
  if (answer) return std::move(static_cast<Solution&>(*answer));
  answer.error().bound += " (server " + settings.server + ")";
  return unexpected(answer.error());
}

Expected<nonlinear::Answer> solve(const NlNonlinear& nl, const Settings& settings, std::stop_token stop) {
  nonlinear::Settings of = settings.nonlinear;
  of.stop = std::move(stop);
  NonlinearTable table(nl.sign(), false, stdout);
  if (settings.reports) of.iteration = [&table](const nonlinear::Iteration& row) { table.report(row); };
  ServerArguments arguments;
  arguments.server = settings.server;
  return solve_nonlinear(nl, of, is_here(settings) ? nullptr : &arguments);
}

void refuse(SolFile& sol, int code, const Error& error) {
  sol.message = banner() + without_controls(error.message());
  sol.code = code;
}

template <class Nl>
void answer(const Nl& nl, const Settings& settings, SolFile& sol) {
  const Interrupt interrupt;
  const auto found = solve(nl, settings, interrupt.token());
  if (found) return add_answer(nl, *found, sol);
  refuse(sol, found.error().code == ErrorCode::invalid_argument ? kNotTaken : kNoAnswer, found.error());
}

// Returns the content of the .sol file; possible only if the header with the sizes can be read.
Expected<SolFile> run(const CommandLine& line) {
  const auto content = formats::read_bytes(line.stub + ".nl");
  if (!content) return unexpected(of_field(line.stub + ".nl", content.error()));
  formats::NlTokens tokens(*content);
  const formats::NlHeader header = tokens.header();
  if (tokens.failed()) return unexpected(of_field(line.stub + ".nl", tokens.error()));
  SolFile sol{.message = "",
              .options = header.options,
              .vb_tolerance = header.vb_tolerance,
              .constraints = header.constraints,
              .variables = header.variables};
  Settings settings;
  if (const char* const server = std::getenv("MARBLE_SERVER")) settings.server = server;
  const char* const words = std::getenv("marble_options");
  for (const auto& assignments : {assignments_of(words == nullptr ? "" : words), line.assignments}) {
    if (const auto applied = apply(assignments, settings); !applied) {
      refuse(sol, kWrongOption, applied.error());
      return sol;
    }
  }
  const std::string name = line.stub.substr(line.stub.find_last_of('/') + 1);
  const auto names = formats::NlNames::beside(line.stub);
  if (const auto nl = formats::parse_nl_problem(*content, name, names)) {
    answer(*nl, settings, sol);
  } else if (const auto bent = formats::parse_nonlinear_nl(*content, name, names)) {
    answer(*bent, settings, sol);
  } else {
    refuse(sol, kNotTaken, bent.error());
  }
  return sol;
}

Expected<void> write(const SolFile& sol, const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(auto file, AtomicFile::open(path));
  file.write(formats::sol_text(sol));
  return file.commit();
}

int fails(const Error& error) {
  complain(error.message());
  return kBadInput;
}

}  // namespace

int drive(int argc, const char* const* argv) {
  const auto line = parse(argc, argv);
  if (!line) return fails(line.error());
  if (line->asks == CommandLine::Asks::version) {
    std::cout << "marble " << kVersion << '\n';
    return kAllSolved;
  }
  if (line->asks == CommandLine::Asks::options) {
    print_options();
    return kAllSolved;
  }
  auto sol = or_out_of_memory(
      [&] { return run(*line); },
      [] { return failure(ErrorCode::resource_exhausted, "is too large for the memory there is"); });
  if (!sol) return fails(sol.error());
  if (!line->from_ampl) {  // for a person, or a reader that does not know that line
    std::cout << sol->message << '\n';
    sol->code.reset();
  }
  const auto written = write(*sol, line->sol_path);
  return written ? kAllSolved : fails(written.error());
}

}  // namespace marble::cli::ampl
