#include "marble/solver.h"

#include <cmath>

#include "path.h"
#include "polish.h"

namespace marble {
namespace {

constexpr double kPolishKappa = 1e-6;  // the partition shows by here
constexpr int kPolishBudget = 100;     // factorizations
constexpr double kPolishLoss = 1e-3;  // a feasible path point may be this much lower than its exact neighbour

bool ended_by_force(Status status) {
  return status == Status::cancelled || status == Status::time_limit || status == Status::iteration_limit;
}

std::vector<double> unscaled(ConstVectorRef values, const Vector& scale, double factor) {
  std::vector<double> result(static_cast<std::size_t>(values.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i)
    result[static_cast<std::size_t>(i)] = factor * values[i] * scale[i];
  return result;
}

}  // namespace

struct Solver::State {
  State(const Problem& user_problem, const Options& user_options)
      : options(user_options),
        problem(scale(user_problem, options.scaling_passes)),
        kkt(make_kkt(problem)),
        path(problem, *kkt, options),
        polish(problem, *kkt),
        initial_z(problem.variables()) {}

  Ending engines(Run& run);
  [[nodiscard]] bool polished(Run& run);
  [[nodiscard]] Solution answer(const Ending& ending, const Iterate& x, const Run& run) const;

  Options options;
  ScaledProblem problem;
  std::unique_ptr<Kkt> kkt;
  PathEngine path;
  Polish polish;
  Vector initial_z;
  const Iterate* best = nullptr;  // of the engine that gave the answer
  double setup_s = 0.0;
};

// The path down to a κ that shows the partition, polish; if that fails, the rest of the path, polish.
Ending Solver::State::engines(Run& run) {
  path.start(initial_z);
  std::optional<Ending> end = path.follow(run, kPolishKappa);
  if (!end && polished(run)) return {Status::solved, describe(violations(problem, polish.images())), {}};
  if (!end) end = path.follow(run, options.kappa_min);
  if (ended_by_force(end->status)) {
    best = &path.iterate();
    return *end;
  }
  if (polished(run)) return {Status::solved, describe(violations(problem, polish.images())), {}};
  best = &path.iterate();
  return *end;
}

bool Solver::State::polished(Run& run) {
  if (!options.polish || !polish.run(path.iterate(), run, kPolishBudget, options.local_search_budget))
    return false;
  const Violations exact = violations(problem, polish.images());
  const double slack = kPolishLoss * std::max(1.0, std::abs(path.objective()));
  const bool worse = within_tolerances(path.violations_at(), options) &&
                     polish.images().objective > path.objective() + slack;
  if (worse || !within_tolerances(exact, options)) return false;
  best = &polish.x();
  return true;
}

Solution Solver::State::answer(const Ending& ending, const Iterate& x, const Run& run) const {
  Images images(problem);
  images.evaluate(problem, x);
  const double cost = 1.0 / problem.cost_scale;
  Solution solution;
  solution.status = ending.status;
  solution.detail = ending.detail;
  solution.certificate = ending.certificate;
  solution.z = unscaled(x.z(), problem.variable_scale, 1.0);
  solution.equality_multipliers = unscaled(x.y(), problem.equality_scale, cost);
  solution.inequality_multipliers = unscaled(x.lambda_w(), problem.inequality_scale, -cost);
  solution.complementarity_multipliers_L = unscaled(x.lambda_L(), problem.left_scale, -cost);
  solution.complementarity_multipliers_R = unscaled(x.lambda_R(), problem.right_scale, -cost);
  solution.objective = cost * images.objective + problem.c0;
  solution.violations = violations(problem, images);
  solution.kkt_residual = cost * max_abs(images.stationarity.cwiseQuotient(problem.variable_scale));
  solution.iterations = run.iterations;
  solution.factorizations = run.factorizations;
  solution.times = run.times;
  solution.times.setup_s = setup_s;
  solution.times.solve_s = run.elapsed_s();
  return solution;
}

Solver::Solver(std::unique_ptr<State> state) : state_(std::move(state)) {}
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;
Solver::~Solver() = default;

Expected<Solver> Solver::create(const Problem& problem, const Options& options) {
  if (auto valid = validate(options); !valid) return unexpected(valid.error());
  const auto begin = Run::Clock::now();
  auto state = std::make_unique<State>(problem, options);
  state->setup_s = std::chrono::duration<double>(Run::Clock::now() - begin).count();
  return Solver(std::move(state));
}

Expected<Solution> Solver::solve(const SolveControls& controls) {
  if (auto valid = Problem::check_initial_point(controls.initial_z, state_->problem.variables()); !valid) {
    return unexpected(valid.error());
  }
  Run run(state_->options, controls);
  state_->initial_z.setZero();
  if (!controls.initial_z.empty()) {
    const Eigen::Map<const Vector> z(controls.initial_z.data(), state_->problem.variables());
    state_->initial_z = z.cwiseQuotient(state_->problem.variable_scale);
  }
  const Ending ending = state_->engines(run);
  return state_->answer(ending, *state_->best, run);
}

Expected<Solution> solve(const ProblemView& view, const Options& options, const SolveControls& controls) {
  const auto problem = Problem::create(view);
  if (!problem) return unexpected(problem.error());
  auto solver = Solver::create(*problem, options);
  if (!solver) return unexpected(solver.error());
  return solver->solve(controls);
}

}  // namespace marble
