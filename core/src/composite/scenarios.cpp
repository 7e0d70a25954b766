#include "marble/composite/scenarios.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "composite/lift.h"
#include "composite/recourse.h"
#include "composite/stage_bytes.h"
#include "composite/stages.h"
#include "model/interrupt.h"
#include "model/text_of.h"
#include "model/tuning.h"

namespace marble {
namespace {

using Clock = std::chrono::steady_clock;

bool is_without_plan(Status status) {
  return status == Status::infeasible || status == Status::locally_infeasible;
}

Expected<void> validate_settings(const ScenarioSettings& s) {
  const auto check = [](bool valid, const char* field, auto value, const char* bound) -> Expected<void> {
    if (valid) return {};
    return unexpected(invalid(std::string("settings.") + field, text_of(static_cast<double>(value)), bound));
  };
  if (auto valid = validate_without_explain(s.options); !valid)
    return unexpected(inside("settings.options", valid.error()));
  for (Expected<void> valid :
       {check(s.initial_sample_size >= 1, "initial_sample_size", s.initial_sample_size, "must be >= 1"),
        check(std::isfinite(s.growth) && s.growth > 1.0, "growth", s.growth, "must be finite and > 1"),
        check(s.max_sample_size >= s.initial_sample_size, "max_sample_size", s.max_sample_size,
              "must be >= initial_sample_size"),
        check(std::isfinite(s.tolerance) && s.tolerance >= 0.0, "tolerance", s.tolerance,
              "must be finite and >= 0"),
        check(s.min_sample_size >= 1, "min_sample_size", s.min_sample_size, "must be >= 1"),
        check(s.max_infeasible_fraction >= 0.0 && s.max_infeasible_fraction <= 1.0, "max_infeasible_fraction",
              s.max_infeasible_fraction, "must be in [0, 1]"),
        check(s.out_of_sample_scenarios >= 0, "out_of_sample_scenarios", s.out_of_sample_scenarios,
              "must be >= 0")}) {
    if (!valid) return valid;
  }
  return {};
}

// Reports the progress of all stages as that of one solve.
class StageProgress final : public ProgressSink {
 public:
  explicit StageProgress(ProgressSink* sink) : sink_(sink) {}
  void begin(const SampleAverageStage& stage, const Solution& before) {
    stage_ = stage.stage;
    scenarios_ = stage.scenarios;
    iterations_ = before.iterations;
    factorizations_ = before.factorizations;
  }
  void report(const Progress& progress) override {
    Progress row = progress;
    row.iteration += iterations_;
    row.factorizations += factorizations_;
    row.stage = stage_;
    row.scenarios = scenarios_;
    sink_->report(row);
  }
  [[nodiscard]] ProgressSink* sink() { return sink_ != nullptr ? this : nullptr; }

 private:
  ProgressSink* const sink_;
  std::int32_t stage_ = 0, iterations_ = 0, factorizations_ = 0;
  std::int64_t scenarios_ = 0;
};

Error too_large(double scenarios, double bytes, std::int64_t most_bytes) {
  return failure(
      ErrorCode::resource_exhausted, "scenarios",
      std::to_string(static_cast<std::int64_t>(scenarios)) + " scenarios: " + general(bytes, 6) + " bytes",
      "a stage, with what it needs at least, must fit into " + std::to_string(most_bytes) + " bytes");
}

// Solves the sample-average stages one after the other.
class StageLoop {
 public:
  StageLoop(const ScenarioProblem& problem, const ScenarioSettings& settings, const SolveControls& controls,
            const SetupControls& setup, Stages stages)
      : problem_(problem),
        settings_(settings),
        controls_(controls),
        setup_(setup),
        stages_(std::move(stages)),
        begun_(controls.begun.value_or(Interrupt::now(controls.pause))),
        until_(after(begun_, settings.options.time_limit_s)),
        interrupt_(controls.stop, until_, controls.pause),
        most_(std::min(settings.max_sample_size, problem.scenarios)),
        progress_(controls.progress) {}

  Expected<ScenarioSolution> run() {
    const PhaseScope phase(controls_.activity, Phase::scenarios, most_);
    std::int64_t count = std::min(settings_.initial_sample_size, most_);
    for (double size = static_cast<double>(settings_.initial_sample_size);;) {
      MARBLE_RETURN_IF_ERROR(draw(1));
      if (const double bytes = bytes_of_stage(count); bytes > most_bytes()) {
        Error error = too_large(static_cast<double>(count), bytes, setup_.most_bytes);
        if (answer_.scenarios == 0) return unexpected(std::move(error));
        return end(ScenarioEnd::too_large, error.message());
      }
      MARBLE_RETURN_IF_ERROR(draw(count));
      if (const auto ended = interrupted())
        return end(*ended, "ended while the numbers of scenarios were drawn");
      SampleAverageStage stage;
      stage.stage = static_cast<std::int32_t>(answer_.stages.size());
      stage.scenarios = count;
      auto solution = solve(stage);
      if (!solution) {
        const Error& error = solution.error();
        if (error.code == ErrorCode::cancelled) return end(ScenarioEnd::cancelled, error.message());
        if (error.code == ErrorCode::deadline_exceeded) return end(ScenarioEnd::time_limit, error.message());
        if (answer_.scenarios == 0) return unexpected(error);
        return end(ScenarioEnd::too_large, error.message());
      }
      if (!is_solved(solution->status)) return end_unsolved(stage, *solution);
      keep(stage, *std::move(solution));
      if (controls_.activity != nullptr) controls_.activity->set_done(Phase::scenarios, count, most_);
      size = std::max(size * settings_.growth, static_cast<double>(count) + 1.0);
      const std::int64_t next =
          size >= static_cast<double>(most_) ? most_ : static_cast<std::int64_t>(std::ceil(size));
      MARBLE_RETURN_IF_ERROR(try_fresh(stage, next));
      report(stage);
      if (const auto ended = end_of(stage)) return end(*ended, stage.detail);
      if (count == most_) return end(ScenarioEnd::samples, stage.detail);
      count = next;
    }
  }

 private:
  [[nodiscard]] double most_bytes() const { return static_cast<double>(setup_.most_bytes); }

  // Estimates with the average size of the scenarios drawn so far; includes all that are drawn already.
  [[nodiscard]] double bytes_of_stage(std::int64_t count) const {
    const auto drawn = static_cast<double>(scenarios_.size());
    const double average = scenarios_bytes_ / drawn;
    const double more = std::max(0.0, drawn - static_cast<double>(count));
    return stage_bytes(stages_, static_cast<double>(count), average, settings_.options) + more * average;
  }

  // Memory that is held between stages.
  [[nodiscard]] double bytes_held() const {
    return scenarios_bytes_ + 2.0 * static_cast<double>(parts_.size()) * stages_.part_bytes() +
           stages_.answer_bytes(static_cast<double>(answer_.scenarios));
  }

  [[nodiscard]] std::int64_t bytes_left(double taken) const {
    return setup_.most_bytes - static_cast<std::int64_t>(std::clamp(taken, 0.0, most_bytes()));
  }

  [[nodiscard]] std::optional<ScenarioEnd> interrupted() const {
    if (!interrupt_.requested()) return std::nullopt;
    return interrupt_.stop_requested() ? ScenarioEnd::cancelled : ScenarioEnd::time_limit;
  }

  // Draws scenarios up to number `count`, or as many as exist. Draws fewer if interrupted.
  Expected<void> draw(std::int64_t count) {
    while (static_cast<std::int64_t>(scenarios_.size()) < std::min(count, problem_.scenarios)) {
      if (!scenarios_.empty() && interrupt_.requested()) return {};
      const auto number = static_cast<std::int64_t>(scenarios_.size());
      MARBLE_ASSIGN_OR_RETURN(auto scenario, problem_.sample(number));
      if (auto valid = stages_.check(scenario); !valid)
        return unexpected(inside("scenario[" + std::to_string(number) + "]", valid.error()));
      scenarios_bytes_ += bytes_of(scenario);
      if (scenarios_bytes_ > most_bytes())
        return unexpected(too_large(static_cast<double>(number + 1), scenarios_bytes_, setup_.most_bytes));
      scenarios_.push_back(std::move(scenario));
    }
    return {};
  }

  [[nodiscard]] std::span<const ScenarioNumbers> scenarios(std::int64_t first, std::int64_t last) const {
    return std::span(scenarios_)
        .subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(last - first));
  }

  // Starts from the last stage's solution, lifted. The search for a distant feasible point comes last: if
  // none exists, it is faster to find a scenario that has no plan alone.
  Expected<Solution> solve(SampleAverageStage& stage) {
    const auto begun = interrupt_.now();
    const auto sample = scenarios(0, stage.scenarios);
    weights_ = normalized_weights(sample);
    std::optional<Solution> start;
    if (answer_.scenarios > 0) start = lift(stage.scenarios);
    MARBLE_ASSIGN_OR_RETURN(auto assembled, stages_.assemble(sample, weights_, interrupt_));
    MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(assembled.view()));
    stage.variables = problem.variables();
    stage.pairs = problem.pairs();
    Options options = settings_.options;
    if (start)
      options.max_local_search_factorizations =
          std::min(options.max_local_search_factorizations, tuning::scenario_budget);
    if (stage.scenarios > 1) options.max_feasibility_factorizations = 0;
    const auto count = static_cast<double>(stage.scenarios);
    const double beside = bytes_held() + stages_.assembled_bytes(count) + 2.0 * stages_.answer_bytes(count) +
                          2.0 * count * stages_.part_bytes();
    SetupControls limits = setup_;
    limits.stop = controls_.stop;
    limits.pause = controls_.pause;
    limits.until = until_;
    limits.most_bytes = bytes_left(beside);
    MARBLE_ASSIGN_OR_RETURN(auto solver, Solver::create(problem, options, limits));
    stage.memory_bytes = solver.memory_bytes() + static_cast<std::int64_t>(beside);
    batch_bytes_ = bytes_left(static_cast<double>(stage.memory_bytes));
    auto solution = solve_from(solver, options, start ? &*start : nullptr, stage);
    if (solution && is_without_plan(solution->status)) {
      find_infeasible(stage);
      if (answer_.infeasible.empty() && stage.scenarios > 1) {
        options.max_feasibility_factorizations = settings_.options.max_feasibility_factorizations;
        solution = solve_from(solver, options, start ? &*start : nullptr, stage);
      }
    }
    if (!solution) return solution;
    stage.status = solution->status;
    stage.detail = solution->detail;
    stage.objective = solution->objective;
    stage.seconds = std::chrono::duration<double>(interrupt_.now() - begun).count();
    return solution;
  }

  // If a start had to be repaired and kept no branch, also solves cold if more stages or starts follow.
  Expected<Solution> solve_from(Solver& solver, Options options, const Solution* start,
                                SampleAverageStage& stage) {
    MARBLE_RETURN_IF_ERROR(solver.set_options(options));
    SolveControls controls = controls_;
    controls.activity = nullptr;  // it shows the stages
    controls.warm_start = start;
    controls.begun = begun_;
    controls.progress = progress_.sink();
    auto solution = solve_and_count(solver, controls, stage);
    if (!solution) return solution;
    const bool stayed_warm = start != nullptr && solution->reference_objective > solution->objective;
    stage.warm = stayed_warm && solution->factorizations <= tuning::warm_small_change;
    const bool goes_on = stage.scenarios < most_ || options.num_starts > 1;
    if (!is_solved(solution->status) || !stayed_warm || stage.warm || !goes_on) return solution;
    stage.searched = true;
    options.max_local_search_factorizations = 0;
    MARBLE_RETURN_IF_ERROR(solver.set_options(options));
    controls.warm_start = nullptr;
    auto other = solve_and_count(solver, controls, stage);
    if (!other) return other;
    return is_solved(other->status) && other->objective < solution->objective ? other : solution;
  }

  Expected<Solution> solve_and_count(Solver& solver, const SolveControls& controls,
                                     SampleAverageStage& stage) {
    progress_.begin(stage, total_);
    MARBLE_ASSIGN_OR_RETURN(auto solution, solver.solve(controls));
    stage.factorizations += solution.factorizations;
    count(solution);
    return solution;
  }

  void count(const Solution& solution) {
    total_.iterations += solution.iterations;
    total_.factorizations += solution.factorizations;
    total_.times += solution.times;
  }

  // Finds the scenarios of the stage that have no plan even alone. Those of solved stages have one.
  void find_infeasible(const SampleAverageStage& stage) {
    if (stage.scenarios == 1) {
      answer_.infeasible = {0};
      return;
    }
    const std::int64_t first = answer_.scenarios;
    const std::vector<Status> alone = solve_alone(
        stages_, scenarios(first, stage.scenarios),
        {settings_.options, until_, controls_.stop, controls_.runner, controls_.pause, batch_bytes_});
    for (std::size_t s = 0; s < alone.size(); ++s)
      if (is_without_plan(alone[s])) answer_.infeasible.push_back(first + static_cast<std::int64_t>(s));
  }

  // Starts new scenarios from their recourse, or, if they have none, from the part of the nearest old
  // scenario.
  Solution lift(std::int64_t count) const {
    Checkpoint checkpoint(interrupt_);
    std::vector<const Solution*> parts;
    for (const Solution& part : parts_) parts.push_back(&part);
    for (std::int64_t s = answer_.scenarios; s < count; ++s) {
      const auto at = static_cast<std::size_t>(s - answer_.scenarios);
      const bool found = at < recourse_.size() && recourse_[at].found();
      parts.push_back(found ? &recourse_[at].solution
                            : nearest_part(scenarios_[static_cast<std::size_t>(s)], checkpoint));
    }
    return lifted(stages_, solution_, parts, weights_);
  }

  [[nodiscard]] const Solution* nearest_part(const ScenarioNumbers& scenario, Checkpoint& checkpoint) const {
    return &parts_[nearest(stages_, scenario, scenarios(0, answer_.scenarios), checkpoint)];
  }

  void keep(const SampleAverageStage& stage, Solution solution) {
    const std::size_t plan = stages_.variables.first.size();
    solution_ = std::move(solution);
    parts_.clear();
    for (std::size_t s = 0; s < weights_.size(); ++s)
      parts_.push_back(scenario_part(stages_, solution_, s, weights_[s]));
    answer_.status = stage.status;
    answer_.scenarios = stage.scenarios;
    answer_.x.assign(solution_.z.begin(), solution_.z.begin() + static_cast<std::ptrdiff_t>(plan));
    answer_.objective = stage.objective;
    answer_.violations = solution_.violations;
  }

  // Limits the search for a recourse to the neighbourhood of its start.
  [[nodiscard]] RecourseControls recourse_controls(std::size_t count) const {
    RecourseControls result{
        settings_.options, until_,
        controls_.stop,    controls_.runner,
        controls_.pause,   bytes_left(bytes_held() + static_cast<double>(count) * stages_.part_bytes())};
    result.options.num_starts = 1;
    result.options.global_search = false;
    result.options.max_local_search_factorizations = result.options.max_feasibility_factorizations = 0;
    result.options.max_iterations = std::min(result.options.max_iterations, tuning::scenario_budget);
    return result;
  }
  // Returns how many out-of-sample scenarios fit beside the held memory, each with its numbers, its recourse
  // and a place among the starts. The solver of one scenario needs the rest; if it does not fit, its batch
  // reports it.
  [[nodiscard]] std::int64_t fresh_that_fit() const {
    const double each = scenarios_bytes_ / static_cast<double>(scenarios_.size()) + stages_.part_bytes() +
                        sizeof(Recourse) + sizeof(const Solution*);
    const double drawn = static_cast<double>(scenarios_.size()) - static_cast<double>(answer_.scenarios);
    const double room = std::max(0.0, most_bytes() - bytes_held()) / each + drawn;
    return static_cast<std::int64_t>(std::min(room, static_cast<double>(std::numeric_limits<Index>::max())));
  }

  Expected<void> try_fresh(SampleAverageStage& stage, std::int64_t next) {
    recourse_.clear();
    if (settings_.out_of_sample_scenarios == 0 && stage.scenarios == most_) return {};
    const bool next_fits = bytes_of_stage(next) <= most_bytes();
    const std::int64_t wanted = stage.scenarios + settings_.out_of_sample_scenarios;
    const std::int64_t last = std::min({problem_.scenarios, next_fits ? std::max(wanted, next) : wanted,
                                        stage.scenarios + fresh_that_fit()});
    MARBLE_RETURN_IF_ERROR(draw(last));
    if (interrupted()) return {};
    const auto drawn = scenarios(stage.scenarios, std::max(stage.scenarios, last));
    if (drawn.empty()) return {};
    const auto begun = interrupt_.now();
    std::vector<const Solution*> starts;
    Checkpoint checkpoint(interrupt_);
    for (const ScenarioNumbers& scenario : drawn) starts.push_back(nearest_part(scenario, checkpoint));
    recourse_ = solve_recourse(stages_, answer_.x, drawn, starts, recourse_controls(drawn.size()));
    for (const Recourse& recourse : recourse_) count(recourse.solution);
    const bool all = std::ranges::none_of(recourse_, [](const Recourse& recourse) {
      return recourse.status == Status::time_limit || recourse.status == Status::cancelled;
    });
    if (all) {
      stage.out_of_sample = judged(drawn, recourse_);
      stage.out_of_sample->seconds = std::chrono::duration<double>(interrupt_.now() - begun).count();
    }
    return {};
  }

  void report(SampleAverageStage& stage) {
    stage.x = answer_.x;
    if (settings_.stage) settings_.stage(stage);
    stage.x = {};
    answer_.stages.push_back(stage);
  }

  [[nodiscard]] std::optional<ScenarioEnd> end_of(const SampleAverageStage& stage) const {
    if (controls_.stop.stop_requested()) return ScenarioEnd::cancelled;
    if (interrupt_.now() >= until_) return ScenarioEnd::time_limit;
    if (settings_.tolerance == 0.0 || stage.scenarios < settings_.min_sample_size || !stage.out_of_sample)
      return std::nullopt;
    const OutOfSample& out_of_sample = *stage.out_of_sample;
    const bool served = static_cast<double>(out_of_sample.infeasible) <=
                        settings_.max_infeasible_fraction * static_cast<double>(out_of_sample.scenarios);
    if (served && out_of_sample.half_width <= settings_.tolerance * std::abs(out_of_sample.mean))
      return ScenarioEnd::interval;
    return std::nullopt;
  }

  Expected<ScenarioSolution> end_unsolved(SampleAverageStage& stage, const Solution& solution) {
    answer_.status = solution.status;
    report(stage);
    if (solution.status == Status::cancelled) return end(ScenarioEnd::cancelled, solution.detail);
    if (solution.status == Status::time_limit) return end(ScenarioEnd::time_limit, solution.detail);
    std::string detail = solution.detail;
    if (!answer_.infeasible.empty())
      detail = "scenario " + std::to_string(answer_.infeasible.front()) + " has no plan by itself; " + detail;
    return end(ScenarioEnd::not_solved, detail);
  }

  Expected<ScenarioSolution> end(ScenarioEnd why, std::string detail) {
    answer_.end = why;
    answer_.detail = std::move(detail);
    if (why == ScenarioEnd::cancelled) answer_.status = Status::cancelled;
    if (why == ScenarioEnd::time_limit) answer_.status = Status::time_limit;
    for (const Solution& part : parts_) answer_.recourse.push_back(part.z);
    Solution& solution = answer_.solution = std::move(solution_);
    solution.status = answer_.status;
    solution.detail = answer_.detail;
    solution.iterations = total_.iterations;
    solution.factorizations = total_.factorizations;
    solution.times = total_.times;
    if (!std::isfinite(solution.reference_objective))
      solution.reference_objective = solution.objective;  // as lifted
    return std::move(answer_);
  }

  const ScenarioProblem& problem_;
  const ScenarioSettings& settings_;
  const SolveControls& controls_;
  const SetupControls& setup_;
  Stages stages_;
  Clock::time_point begun_, until_;
  Interrupt interrupt_;
  std::int64_t most_;
  StageProgress progress_;
  Solution total_;  // only iterations, factorizations and times
  std::vector<ScenarioNumbers> scenarios_;
  double scenarios_bytes_ = 0.0;
  std::vector<double> weights_;     // of the stage
  Solution solution_;               // of the newest solved stage
  std::vector<Solution> parts_;     // of solution_, by scenario
  std::vector<Recourse> recourse_;  // of the scenarios after that stage
  std::int64_t batch_bytes_ = 0;    // memory for a solver of one scenario beside the stage's solver
  ScenarioSolution answer_;
};

}  // namespace

const char* to_string(ScenarioEnd end) {
  switch (end) {
    case ScenarioEnd::interval:
      return "interval";
    case ScenarioEnd::samples:
      return "samples";
    case ScenarioEnd::not_solved:
      return "not_solved";
    case ScenarioEnd::too_large:
      return "too_large";
    case ScenarioEnd::time_limit:
      return "time_limit";
    case ScenarioEnd::cancelled:
      return "cancelled";
  }
  return "?";
}

Expected<void> check_scenarios(const ScenarioProblem& problem, const ScenarioSettings& settings) {
  MARBLE_RETURN_IF_ERROR(validate_settings(settings));
  const auto stages = Stages::create(problem);
  return stages ? Expected<void>() : unexpected(stages.error());
}

Expected<ScenarioSolution> solve_scenarios(const ScenarioProblem& problem, const ScenarioSettings& settings,
                                           const SolveControls& controls, const SetupControls& setup) {
  MARBLE_RETURN_IF_ERROR(validate_settings(settings));
  MARBLE_ASSIGN_OR_RETURN(auto stages, Stages::create(problem));
  return StageLoop(problem, settings, controls, setup, std::move(stages)).run();
}

Expected<void> check_initial_sample(const ScenarioProblem& problem, const ScenarioSettings& settings,
                                    std::int64_t most_bytes) {
  MARBLE_ASSIGN_OR_RETURN(const auto stages, Stages::create(problem));
  MARBLE_ASSIGN_OR_RETURN(const auto first, problem.sample(0));
  const auto count = static_cast<double>(std::min(settings.initial_sample_size, problem.scenarios));
  const double bytes = stage_bytes(stages, count, bytes_of(first), settings.options);
  if (bytes <= static_cast<double>(most_bytes)) return {};
  return unexpected(of_field("settings.initial_sample_size", too_large(count, bytes, most_bytes)));
}

Expected<OwnedProblem> assemble_scenarios(const ScenarioProblem& problem, std::int64_t scenarios) {
  MARBLE_ASSIGN_OR_RETURN(const auto stages, Stages::create(problem));
  if (scenarios < 1 || scenarios > problem.scenarios)
    return unexpected(
        invalid("scenarios", std::to_string(scenarios), "must be >= 1, and no more than there are"));
  std::vector<ScenarioNumbers> drawn;
  for (std::int64_t i = 0; i < scenarios; ++i) {
    MARBLE_ASSIGN_OR_RETURN(auto scenario, problem.sample(i));
    if (auto valid = stages.check(scenario); !valid)
      return unexpected(inside("scenario[" + std::to_string(i) + "]", valid.error()));
    drawn.push_back(std::move(scenario));
  }
  return stages.assemble(drawn, normalized_weights(drawn));
}

}  // namespace marble
