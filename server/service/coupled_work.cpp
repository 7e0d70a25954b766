#include "service/coupled_work.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "marble/composite/coupled_progress.h"
#include "marble/convert.h"
#include "marble/convert_coupled.h"

namespace marble::server {
namespace {

using std::chrono::steady_clock;

// The dense algebra of an iteration takes the cube of these.
constexpr std::int64_t kMostRows = 1000;      // rows that couple the blocks
constexpr std::int64_t kMostBlockRows = 250;  // rows with entries of one block

Error as_in_message(const Error& error) { return of_field(coupled_message_field(error.field), error); }

Expected<void> check_count(const Config& config, std::int64_t count, const std::string& field,
                           const char* what) {
  if (count <= config.coupled_blocks) return {};
  return unexpected(failure(
      ErrorCode::resource_exhausted, field, std::to_string(count) + what,
      "must be at most " + std::to_string(config.coupled_blocks) + " (the server's limit coupled_blocks)"));
}

// Number of rows with entries of the block.
std::int64_t rows_of(const SparseMatrixView& coupling) {
  std::vector<bool> seen(static_cast<std::size_t>(coupling.rows));
  for (const Index row : coupling.row_indices) seen[static_cast<std::size_t>(row)] = true;
  return std::ranges::count(seen, true);
}

Expected<void> check_rows(const Config& config, const CoupledView& view) {
  const auto m = static_cast<std::int64_t>(view.coupling_rhs.size());
  if (m > kMostRows) {
    return unexpected(invalid("coupled.coupling_rhs", std::to_string(m),
                              "rows tie the blocks; must be at most " + std::to_string(kMostRows)));
  }
  for (std::size_t k = 0; k < view.blocks.size(); ++k) {
    const std::int64_t own = rows_of(view.blocks[k].coupling);
    if (own > kMostBlockRows) {
      return unexpected(invalid("coupled.blocks[" + std::to_string(k) + "].coupling", std::to_string(own),
                                "rows see the block; must be at most " + std::to_string(kMostBlockRows)));
    }
  }
  const std::int64_t bytes = working_bytes(view);
  if (bytes <= config.solve_bytes) return {};
  return unexpected(failure(ErrorCode::resource_exhausted, "coupled.blocks",
                            std::to_string(bytes) + " bytes of dense matrices and copies",
                            "must fit into " + std::to_string(config.solve_bytes) + " bytes (solve_bytes)"));
}

// The parts that differ between blocks and segments: the solve, and what is reported of it.
using Reported = std::function<void(v1::CoupledOutcome*)>;
using Work = std::function<Expected<Solution>(const CoupledControls&, Reported&)>;

Work blocks_work(const v1::SolveRequest& request, const CoupledOptions& settings) {
  return [&request, settings](const CoupledControls& given, Reported& reported) -> Expected<Solution> {
    const CoupledView view = coupled_of(request.coupled());
    const CoupledStart start{
        {request.coupled().coupling_multipliers().begin(), request.coupled().coupling_multipliers().end()},
        {}};
    CoupledControls controls = given;
    if (!start.coupling_multipliers.empty()) controls.start = &start;
    auto solved = solve_coupled(view, settings, controls);
    if (!solved) return unexpected(as_in_message(solved.error()));
    solved->coordination.answers.clear();
    reported = [coordination = std::move(solved->coordination), objective = solved->blocks_objective](
                   v1::CoupledOutcome* outcome) { to_message(coordination, objective, outcome); };
    return std::move(solved->monolithic);
  };
}

Expected<Work> segments_work(const Config& config, const v1::SolveRequest& request,
                             const CoupledOptions& settings) {
  const v1::Segments& segments = request.coupled().segments();
  SegmentsOptions options{.coupled = settings, .num_segments = segments.num_segments()};
  if (segments.has_overlap()) options.overlap = segments.overlap();
  if (request.coupled().coupling_rhs_size() > 0 || request.coupled().coupling_multipliers_size() > 0)
    return unexpected(
        invalid("coupled.segments", "must be alone: coupling_rhs and coupling_multipliers are of blocks"));
  MARBLE_RETURN_IF_ERROR(
      check_count(config, options.num_segments, "coupled.segments.num_segments", " segments"));
  const std::span stages(segments.stages().data(), static_cast<std::size_t>(segments.stages_size()));
  const auto problem = Problem::create(view_of(request.problem()));
  if (!problem) return unexpected(problem.error());
  if (stages.size() != static_cast<std::size_t>(problem->variables())) {
    return unexpected(invalid("coupled.segments.stages", std::to_string(stages.size()),
                              "must be " + std::to_string(problem->variables()) + ", one a variable"));
  }
  if (auto valid = options.check(); !valid) return unexpected(as_in_message(valid.error()));
  if (auto dealt = segments_by_stage(stages, options.num_segments); !dealt)
    return unexpected(as_in_message(dealt.error()));
  return [problem = *problem, stages, options](const CoupledControls& controls,
                                               Reported& reported) -> Expected<Solution> {
    auto solved = solve_in_segments(problem, stages, options, controls);
    if (!solved) return unexpected(as_in_message(solved.error()));
    Solution whole = std::move(solved->whole);
    solved->coordination.answers.clear();
    reported = [segments_reported = *std::move(solved)](v1::CoupledOutcome* outcome) {
      to_message(segments_reported.coordination, segments_reported.blocks_objective, outcome);
      outcome->set_sweep_objective(segments_reported.sweep_objective);
      outcome->set_sweep_factorizations(segments_reported.sweep_factorizations);
    };
    return whole;
  };
}

}  // namespace

Expected<BlockPlace> check_blocks(const Config& config, const v1::SolveRequest& request) {
  v1::Problem other = request.problem();
  other.clear_name();
  if (other.ByteSizeLong() > 0)
    return unexpected(invalid("problem", "must have nothing but its name: blocks have the problems"));
  if (request.coupled().has_segments())
    return unexpected(invalid("coupled.segments", "must be absent where there are blocks"));
  MARBLE_RETURN_IF_ERROR(check_count(config, request.coupled().blocks_size(), "coupled.blocks", " blocks"));
  const CoupledView view = coupled_of(request.coupled());
  if (auto valid = check(view); !valid) return unexpected(as_in_message(valid.error()));
  MARBLE_RETURN_IF_ERROR(check_rows(config, view));
  const auto& coupling_multipliers = request.coupled().coupling_multipliers();
  if (!coupling_multipliers.empty()) {
    const std::span numbers(coupling_multipliers.data(),
                            static_cast<std::size_t>(coupling_multipliers.size()));
    MARBLE_RETURN_IF_ERROR(check_numbers(numbers, view.coupling_rhs.size(), "coupled.coupling_multipliers"));
  }
  BlockPlace sizes = monolithic_places(view).back();
  sizes.equalities += static_cast<Index>(view.coupling_rhs.size());
  return sizes;
}

Expected<void> set_coupled_work(const Config& config, std::shared_ptr<const v1::SolveRequest> request,
                                const Options& options, Job& job) {
  const std::string alone = "must be absent: coupled problems have their own starts";
  if (request->initial_point().z_size() > 0) return unexpected(invalid("initial_point.z", alone));
  if (request->has_warm_start()) return unexpected(invalid("warm_start", alone));
  if (request->has_scenarios()) return unexpected(invalid("scenarios", "must be absent beside coupled"));
  if (request->has_sensitivity())
    return unexpected(
        invalid("sensitivity", "must be absent beside coupled: ask for it with the monolithic problem"));
  const bool blocks = has_blocks(*request);
  if (!blocks && !request->coupled().has_segments())
    return unexpected(invalid("coupled.blocks", "or segments must be there"));
  CoupledOptions settings = blocks ? CoupledOptions{} : SegmentsOptions{}.coupled;
  settings.options = options;
  take_settings(request->coupled(), settings);
  if (auto valid = settings.check(); !valid) return unexpected(as_in_message(valid.error()));
  if (blocks && settings.freeze_after < 1) {
    return unexpected(
        invalid("coupled.freeze_after", std::to_string(settings.freeze_after), "must be >= 1 of blocks"));
  }
  Work work;
  if (blocks) {
    work = blocks_work(*request, settings);
  } else {
    MARBLE_ASSIGN_OR_RETURN(work, segments_work(config, *request, settings));
  }
  const auto reported = std::make_shared<Reported>();
  job.also = [reported](v1::Solution* solution) {
    if (*reported) (*reported)(solution->mutable_coupled());
  };
  const SetupControls limits{.most_bytes = config.solve_bytes, .most_factorization_s = config.solve_seconds};
  // The work borrows its parts of the request.
  job.work = [request = std::move(request), work = std::move(work), limits,
              reported](const SolveControls& given) -> Expected<Solution> {
    CoupledControls controls{.stop = given.stop,
                             .runner = given.runner,
                             .pause = given.pause,
                             .setup = limits,
                             .begun = steady_clock::now(),
                             .activity = given.activity};
    if (given.begun) controls.begun = given.begun;
    if (given.progress != nullptr) {
      controls.progress = [&](const CoupledIteration& iteration) {
        std::chrono::duration<double> past = steady_clock::now() - *controls.begun;
        if (controls.pause != nullptr) past -= controls.pause->paused();
        given.progress->report(row_of(iteration, past.count()));
      };
    }
    return work(controls, *reported);
  };
  return {};
}

}  // namespace marble::server
