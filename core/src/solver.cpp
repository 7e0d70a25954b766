#include "marble/solver.h"

#include <cmath>

#include "strategy.h"

namespace marble {
namespace {

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
        strategy(problem, *kkt, options),
        initial_z(problem.variables()) {}

  [[nodiscard]] Solution answer(const Ending& ending, const Iterate& x, const Run& run) const;

  Options options;
  ScaledProblem problem;
  std::unique_ptr<Kkt> kkt;
  Strategy strategy;
  Vector initial_z;
  double setup_s = 0.0;
};

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
  const Ending ending = state_->strategy.run(run, state_->initial_z);
  return state_->answer(ending, state_->strategy.best(), run);
}

Expected<Solution> solve(const ProblemView& view, const Options& options, const SolveControls& controls) {
  const auto problem = Problem::create(view);
  if (!problem) return unexpected(problem.error());
  auto solver = Solver::create(*problem, options);
  if (!solver) return unexpected(solver.error());
  return solver->solve(controls);
}

}  // namespace marble
