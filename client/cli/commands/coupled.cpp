// Solves problems coupled by rows, or a long horizon in segments, and prints each iteration.
#include "marble/composite/coupled.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "file_bytes.h"
#include "formats.h"
#include "output/json.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

// The content of a file of coupled problems, owned.
struct CoupledFile {
  std::vector<OwnedProblem> blocks;
  std::vector<SparseMatrix> coupling;
  std::vector<double> coupling_rhs;

  // A view of its arrays; this must outlive the view.
  [[nodiscard]] CoupledView view() const;
};

CoupledView CoupledFile::view() const {
  CoupledView view{{}, coupling_rhs};
  for (std::size_t k = 0; k < blocks.size(); ++k)
    view.blocks.push_back({blocks[k].name, blocks[k].view(), coupling[k].view()});
  return view;
}

template <class Value>
Expected<Value> field_in(const nlohmann::json& object, const char* name) {
  if (!object.is_object() || !object.contains(name)) return unexpected(invalid(name, "must be there"));
  try {
    return object.at(name).get<Value>();
  } catch (const nlohmann::json::exception&) {
    return unexpected(invalid(name, "is of the wrong type"));
  }
}

Expected<SparseMatrix> coupling_of(const nlohmann::json& object) {
  const auto rows = field_in<Index>(object, "rows"), columns = field_in<Index>(object, "cols");
  auto i = field_in<std::vector<Index>>(object, "i"), j = field_in<std::vector<Index>>(object, "j");
  auto v = field_in<std::vector<double>>(object, "v");
  for (const auto* const size : {&rows, &columns})
    if (!*size) return unexpected(size->error());
  for (const auto* const list : {&i, &j})
    if (!*list) return unexpected(list->error());
  if (!v) return unexpected(v.error());
  if (*rows < 0) return unexpected(invalid("rows", std::to_string(*rows), "must be >= 0"));
  if (*columns < 0) return unexpected(invalid("cols", std::to_string(*columns), "must be >= 0"));
  if (i->size() != v->size() || j->size() != v->size())
    return unexpected(invalid("v", std::to_string(v->size()), "must have as many entries as i and j"));
  Triplets entries;
  entries.rows = *std::move(i);
  entries.columns = *std::move(j);
  entries.values = *std::move(v);
  return compress(*rows, *columns, entries, "");
}

Expected<void> take_block(const nlohmann::json& object, const std::filesystem::path& beside,
                          CoupledFile& file) {
  MARBLE_ASSIGN_OR_RETURN(const auto name, field_in<std::string>(object, "problem"));
  auto read = formats::read_any_problem((beside / name).string());
  if (!read) {
    const std::string& field = read.error().field;
    return unexpected(of_field("problem (" + name + ")" + (field.empty() ? "" : "." + field), read.error()));
  }
  file.blocks.push_back(std::move(read->problem));
  SparseMatrix& coupling = file.coupling.emplace_back();
  if (!object.contains("coupling")) return {};
  auto matrix = coupling_of(object.at("coupling"));
  if (!matrix) return unexpected(inside("coupling", matrix.error()));
  coupling = *std::move(matrix);
  return {};
}

// Reads {"coupling_rhs": [4], "blocks": [{"problem": "left.json", "coupling": {"rows": 1, "cols": 1, "i":
// [0], "j": [0], "v": [1]}}, …]}; paths are relative to this file, in any format. Errors name the field, and
// the file of a block that cannot be read.
Expected<CoupledFile> read_coupled(const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(const auto bytes, formats::read_bytes(path));
  MARBLE_ASSIGN_OR_RETURN(const auto content, parsed_object(bytes));
  CoupledFile file;
  MARBLE_ASSIGN_OR_RETURN(file.coupling_rhs, field_in<std::vector<double>>(content, "coupling_rhs"));
  if (!content.contains("blocks") || !content.at("blocks").is_array())
    return unexpected(invalid("blocks", "must be a list"));
  const nlohmann::json& blocks = content.at("blocks");
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    auto taken = take_block(blocks.at(k), std::filesystem::path(path).parent_path(), file);
    if (!taken) return unexpected(inside("blocks[" + std::to_string(k) + "]", taken.error()));
  }
  MARBLE_RETURN_IF_ERROR(check(file.view()));
  return file;
}

struct CoupledArguments {
  std::string file;
  ServerArguments server;
  SolverArguments solver;
  Priority priority = Priority::by_method;
  Index segments = 0, stage_variables = 0, overlap = -1;
  bool sessions = false;
};

int file_of_blocks_fails(const std::string& path, const Error& error) {
  complain(path, error.message());
  return exit_code_of_local(error);
}

void report_iteration(const CoupledArguments& arguments, const CoupledIteration& now) {
  if (arguments.server.json()) {
    std::cout << line({{"iteration", now.iteration},
                       {"objective", now.objective},
                       {"coupling_violation", now.coupling_violation},
                       {"step", now.step},
                       {"proximal", now.proximal},
                       {"factorizations", now.factorizations}})
              << '\n'
              << std::flush;
    return;
  }
  if (now.iteration == 1)
    std::printf("%5s %15s %12s %12s %9s %8s\n", "iter", "objective", "rows", "price step", "rho", "fact");
  std::printf("%5d %15.7e %12.2e %12.2e %9.1e %8lld\n", now.iteration, now.objective, now.coupling_violation,
              now.step, now.proximal, static_cast<long long>(now.factorizations));
  std::fflush(stdout);
}

int report_answer(const CoupledArguments& arguments, const Solution& solution,
                  const Coordination& coordination, const std::string& job_id, std::int32_t repeated,
                  const Json& more) {
  const double violation = std::max(
      {solution.violations.equality, solution.violations.inequality, solution.violations.complementarity});
  if (arguments.server.json()) {
    Json json = {{"file", arguments.file},
                 {"job_id", job_id},
                 {"status", to_string(solution.status)},
                 {"detail", solution.detail},
                 {"objective", solution.objective},
                 {"violation", violation},
                 {"coordination",
                  {{"status", to_string(coordination.status)},
                   {"iterations", coordination.last.iteration},
                   {"frozen_at", coordination.frozen_at},
                   {"factorizations", coordination.last.factorizations}}},
                 {"repeated", repeated}};
    json.update(more);
    std::cout << line(json) << '\n' << std::flush;
  } else {
    std::printf(
        "%s: objective %.10g, largest violation %.1e, %lld factorizations of blocks and %d after\n%s\n",
        to_string(solution.status), solution.objective, violation,
        static_cast<long long>(coordination.last.factorizations), solution.factorizations,
        without_controls(solution.detail).c_str());
    if (repeated > 0) std::printf("%d steps were asked for again: a server was lost\n", repeated);
  }
  return is_solved(solution.status) ? kAllSolved : kNotSolved;
}

int run_blocks(const CoupledArguments& arguments, const Options& options, const Client& client,
               const CoupledControls& controls, const CallControls& call) {
  const auto file = read_coupled(arguments.file);
  if (!file) return file_of_blocks_fails(arguments.file, file.error());
  CoupledOptions settings;
  settings.options = options;
  const CoupledView view = file->view();
  const auto answer = arguments.sessions ? client.solve_coupled_by_sessions(view, settings, controls)
                                         : client.solve_coupled(view, settings, controls, call);
  if (!answer) return server_fails(arguments.server, answer.error());
  const auto coupling_multipliers = answer->coupling_multipliers();
  Json z = Json::array();
  for (std::size_t k = 0; k + 1 < answer->places.size(); ++k) {
    const auto first = answer->monolithic.z.begin();
    z.push_back(
        std::vector<double>(first + answer->places[k].variables, first + answer->places[k + 1].variables));
  }
  return report_answer(arguments, answer->monolithic, answer->coordination, answer->job_id, answer->repeated,
                       {{"coupling_multipliers",
                         std::vector<double>(coupling_multipliers.begin(), coupling_multipliers.end())},
                        {"z", z}});
}

int run_segments(const CoupledArguments& arguments, const Options& options, const Client& client,
                 const CoupledControls& controls, CallControls& call) {
  const auto file = formats::read_any_problem(arguments.file);
  if (!file) return file_of_blocks_fails(arguments.file, file.error());
  const auto problem = Problem::create(file->problem.view());
  if (!problem) return file_of_blocks_fails(arguments.file, problem.error());
  std::vector<Index> stages(static_cast<std::size_t>(problem->variables()));
  for (Index j = 0; j < problem->variables(); ++j)
    stages[static_cast<std::size_t>(j)] = j / arguments.stage_variables;
  SegmentsOptions settings{.num_segments = arguments.segments, .overlap = arguments.overlap};
  settings.coupled.options = options;
  call.problem_name = file->problem.name;
  const auto answer = arguments.sessions
                          ? client.solve_in_segments_by_sessions(*problem, stages, settings, controls)
                          : client.solve_in_segments(*problem, stages, settings, controls, call);
  if (!answer) return server_fails(arguments.server, answer.error());
  return report_answer(arguments, answer->whole, answer->coordination, answer->job_id, answer->repeated,
                       {{"sweep_objective", answer->sweep_objective}, {"z", answer->whole.z}});
}

int run(const CoupledArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  const CoupledControls controls{
      .progress = [&](const CoupledIteration& now) { report_iteration(arguments, now); },
      .stop = interrupt.token()};
  CallControls call;
  call.priority = arguments.priority;
  return arguments.segments > 0 ? run_segments(arguments, *options, *client, controls, call)
                                : run_blocks(arguments, *options, *client, controls, call);
}

}  // namespace

void add_coupled(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<CoupledArguments>();
  CLI::App* command = program.add_subcommand(
      "coupled", "Solve problems coupled by linear rows, or one long horizon in segments, by decomposition");
  command
      ->add_option("FILE", arguments->file,
                   "JSON: \"coupling_rhs\", and \"blocks\" of \"problem\" (a file) and \"coupling\" (rows, "
                   "cols, i, j, "
                   "v); with --segments, a problem file")
      ->required();
  auto* segments =
      command->add_option("--segments", arguments->segments, "cut the horizon into this many segments");
  auto* width = command->add_option("--stage-variables", arguments->stage_variables,
                                    "number of variables per stage; stages are stored one after the other");
  segments->needs(width)->check(CLI::Range(Index{1}, static_cast<Index>(kMostBlocks)));
  width->needs(segments)->check(CLI::Range(Index{1}, std::numeric_limits<Index>::max()));
  command
      ->add_option("--overlap", arguments->overlap,
                   "stages by which the segments of the forward pass overlap; -1: a third of a segment")
      ->needs(segments)
      ->capture_default_str();
  command->add_flag("--sessions", arguments->sessions,
                    "solve each block in a session; the blocks are distributed over the servers of --server");
  add_server_arguments(*command, arguments->server);
  add_priority_argument(*command, arguments->priority);
  add_solver_arguments(*command, arguments->solver);
  command->footer(kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
