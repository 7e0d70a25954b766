#include "marble/solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "branch/branch_derivatives.h"
#include "branch/parametric.h"
#include "global/explain.h"
#include "model/printed.h"
#include "model/text_of.h"
#include "model/tuning.h"
#include "path/proof_record.h"
#include "solver/answer.h"
#include "solver/solver_bytes.h"
#include "solver/strategy.h"

namespace marble {
namespace {

const char* nonconvex_remark(SecondOrder second_order) {
  switch (second_order) {
    case SecondOrder::minimum:
    case SecondOrder::convex:
      return "; Q is not convex: a local minimum";
    case SecondOrder::saddle:
      return "; Q is not convex: a saddle point or a maximum";
    default:
      return "; Q is not convex: a stationary point, perhaps no local minimum";
  }
}

SolverSizes sizes_of(const Problem& problem) {
  const ProblemView& view = problem.view();
  SolverSizes sizes{.variables = static_cast<double>(problem.variables()),
                    .equalities = static_cast<double>(problem.equalities()),
                    .inequalities = static_cast<double>(problem.inequalities()),
                    .pairs = static_cast<double>(problem.pairs())};
  for (const SparseMatrixView* matrix : {&view.Q, &view.A, &view.C, &view.L, &view.R})
    sizes.entries += static_cast<double>(matrix->values.size());
  return sizes;
}

// The maximum number of flops of one factorization. No machine does more than tuning::flops_per_second of
// them on one thread (about 10⁹ are usual). A factorization that takes less than tuning::never_refused_s at
// that rate is not refused, since a time limit ends it.
struct MostFlops {
  MostFlops(const Options& options, const SetupControls& controls)
      : by_time_limit(options.time_limit_s < controls.most_factorization_s),
        seconds(by_time_limit ? options.time_limit_s : controls.most_factorization_s) {}

  [[nodiscard]] double flops() const {
    return tuning::flops_per_second * std::max(tuning::never_refused_s, seconds);
  }
  [[nodiscard]] Error refusal(double needed) const {
    return failure(ErrorCode::resource_exhausted, "problem",
                   "a factorization of " + general(needed, 2) + " flops",
                   "must have at most " + general(flops(), 2) + " to fit " +
                       (by_time_limit ? "the time limit of " : "the limit for one of ") +
                       general(seconds, 6) + " s on the fastest machine");
  }

  bool by_time_limit;
  double seconds;
};

Error ended(bool stopped) {
  const char* const when = "while the problem was prepared";
  return stopped ? failure(ErrorCode::cancelled, std::string("stopped ") + when)
                 : failure(ErrorCode::deadline_exceeded, std::string("the time was up ") + when);
}

bool bears(const Vector& start) { return max_abs(start) <= tuning::farthest_start; }

// Published methods are valid only where the caller has brought them.
Expected<void> validate_with(const ReferenceMethods* methods, const Options& options) {
  return methods != nullptr ? validate_ranges(options) : validate(options);
}

// With other equations, an interrupted solve cannot be resumed.
bool change_method(const Options& before, const Options& now) {
  return before.method != now.method || before.path != now.path || before.polish != now.polish ||
         before.global_search != now.global_search;
}

// Sets what is known about the global optimum, from a certificate or a tree.
void take_proof(const Strategy::Answer& found, Solution& solution) {
  const bool infeasible = solution.status == Status::infeasible;
  found.tree.report(solution);
  solution.proved = found.tree.proved || infeasible || solution.status == Status::unbounded;
  if (infeasible) solution.bound = std::numeric_limits<double>::infinity();
}

// Uses the solve's last factor if it belongs to the branch. Further starts may leave a different one behind,
// depending on the threads; the branch is then factorized again, so that the counters are the same.
Expected<SensitivityAnswer> sensitivity_of(const Strategy::Answer& found, const SensitivityRequest& request,
                                           BranchDerivatives& derivatives, bool may_reuse_factor, Run& run) {
  MARBLE_RETURN_IF_ERROR(must_be_solved(found.ending.status));
  MARBLE_RETURN_IF_ERROR(derivatives.begin(run, *found.x, may_reuse_factor));
  return derivatives.answer(run, request);
}

}  // namespace

struct Solver::State {
  State(const Problem& user_problem, const Options& in_force, ScaledProblem scaled,
        std::unique_ptr<Kkt> chosen_kkt, const ReferenceMethods* reference_methods)
      : options(in_force),
        sizes(PartSizes::of(user_problem)),
        problem(std::move(scaled)),
        kkt(std::move(chosen_kkt)),
        methods(reference_methods),
        strategy(problem, *kkt, options, methods),
        initial_z(problem.variables()),
        warm_start(problem) {}

  void add_sensitivity(const Strategy::Answer& found, const SensitivityRequest& request, Run& run,
                       Solution& solution);

  Options options;
  PartSizes sizes;
  ScaledProblem problem;
  std::unique_ptr<Kkt> kkt;
  const ReferenceMethods* methods;
  Strategy strategy;
  Vector initial_z;
  Iterate warm_start;
  double setup_s = 0.0;
  std::int64_t memory_bytes = 0;
  double bytes_left = 0.0;        // of what the solver may take
  bool has_new_matrices = false;  // since their scaling was fitted
  struct Scaling {
    ScaleFactors factors;
    ScaledSizes sizes;
  };
  std::optional<Scaling> first_scaling;  // of the set-up, kept for a batch
  bool is_rescaled = false;              // since then
  std::vector<Iterate> near;             // scaled solutions of similar problems
};

void Solver::State::add_sensitivity(const Strategy::Answer& found, const SensitivityRequest& request,
                                    Run& run, Solution& solution) {
  BranchPoint& point = strategy.point();
  const std::int32_t before = point.back_substitutions();
  BranchDerivatives derivatives(problem, sizes, point);
  solution.sensitivity = sensitivity_of(found, request, derivatives, options.num_starts == 1, run);
  if (*solution.sensitivity) {
    (*solution.sensitivity)->factorizations = run.factorizations - solution.factorizations;
    (*solution.sensitivity)->back_substitutions = point.back_substitutions() - before;
  }
  solution.factorizations = run.factorizations;
  solution.times = run.times;
  solution.times.solve_s = run.elapsed_s();
}

Expected<void> check_warm_start(const Solution& start, const PartSizes& sizes) {
  for (const auto& [values, size, field] :
       {std::tuple{&start.z, sizes.g, "warm_start.z"},
        std::tuple{&start.equality_multipliers, sizes.b, "warm_start.equality_multipliers"},
        std::tuple{&start.inequality_multipliers, sizes.d, "warm_start.inequality_multipliers"},
        std::tuple{&start.complementarity_multipliers_L, sizes.l, "warm_start.complementarity_multipliers_L"},
        std::tuple{&start.complementarity_multipliers_R, sizes.r,
                   "warm_start.complementarity_multipliers_R"}}) {
    MARBLE_RETURN_IF_ERROR(check_numbers(*values, size, field));
  }
  if (std::isnan(start.reference_objective))
    return unexpected(invalid("warm_start.reference_objective", "nan", "must be a number"));
  return {};
}

Solver::Solver(std::unique_ptr<State> state) : state_(std::move(state)) {}
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;
Solver::~Solver() = default;

Expected<Solver> Solver::create(const Problem& problem, const Options& user_options,
                                const SetupControls& controls) {
  const ReferenceMethods* const methods = controls.reference_methods;
  MARBLE_RETURN_IF_ERROR(validate_with(methods, user_options));
  const Options options = in_force(user_options);
  const Interrupt interrupt(controls.stop, controls.until, controls.pause);
  const auto begin = interrupt.now();
  const auto refuse = [&controls](double bytes) {
    return unexpected(failure(ErrorCode::resource_exhausted, "problem",
                              std::to_string(static_cast<std::int64_t>(bytes)) + " bytes of memory",
                              "a solver may take at most " + std::to_string(controls.most_bytes)));
  };
  const double own_bytes = least_solver_bytes(sizes_of(problem), options, methods);
  const auto limit = static_cast<double>(controls.most_bytes);
  if (own_bytes > limit) return refuse(own_bytes);
  if (interrupt.requested()) return unexpected(ended(interrupt.stop_requested()));
  ScaledProblem scaled = scale(problem, options.scaling_passes, interrupt);
  if (interrupt.requested()) return unexpected(ended(interrupt.stop_requested()));
  const MostFlops most(options, controls);
  KktCost least;
  std::unique_ptr<Kkt> kkt = make_kkt(scaled, {limit - own_bytes, most.flops()}, interrupt, least);
  if (kkt == nullptr) {
    if (interrupt.requested()) return unexpected(ended(interrupt.stop_requested()));
    if (least.bytes > limit - own_bytes) return refuse(own_bytes + least.bytes);
    return unexpected(most.refusal(least.flops));
  }
  kkt->attend({});
  const double factor_bytes = kkt->bytes() + FurtherStarts::extra_bytes(options, kkt->bytes());
  if (own_bytes + factor_bytes > limit) return refuse(own_bytes + factor_bytes);
  if (interrupt.requested()) return unexpected(ended(interrupt.stop_requested()));
  auto state = std::make_unique<State>(problem, options, std::move(scaled), std::move(kkt), methods);
  state->setup_s = std::chrono::duration<double>(interrupt.now() - begin).count();
  const double tree_bytes = std::min(limit - own_bytes - factor_bytes, tuning::tree_most_bytes);
  const double kept_bytes =
      options.global_search ? std::min(tuning::tree_kept * tree_bytes, tuning::tree_kept_bytes) : 0.0;
  state->memory_bytes = static_cast<std::int64_t>(own_bytes + factor_bytes + kept_bytes);
  state->bytes_left = limit - own_bytes - factor_bytes - kept_bytes;
  state->strategy.allow_tree(tree_bytes, kept_bytes);
  return Solver(std::move(state));
}

Expected<void> Solver::update(const ProblemUpdate& update) {
  MARBLE_RETURN_IF_ERROR(state_->sizes.check(update));
  take(update);
  fit_scaling();
  return {};
}

void Solver::take(const ProblemUpdate& checked) {
  if (!rescale(checked, state_->problem)) return;
  state_->has_new_matrices = true;
  load_matrices();
}

void Solver::fit_scaling() {
  const bool changed = std::exchange(state_->has_new_matrices, false);
  if (!refit_scaling(state_->problem, state_->options.scaling_passes, changed)) return;
  state_->is_rescaled = true;
  state_->strategy.forget_scaling();
  load_matrices();
}

// For a batch: back to the state after create(), with all numbers of the problem that was set up, so that
// nothing of earlier elements is left. Convexity is decided here, so that no element depends on which one had
// to know it first.
void Solver::return_to_setup(const ProblemUpdate& all_numbers) {
  ScaledProblem& p = state_->problem;
  if (!state_->first_scaling)
    state_->first_scaling = {{p.variable_scale, p.equality_scale, p.row_scale, p.cost_scale}, p.sizes};
  const auto& [factors, sizes] = *state_->first_scaling;
  p.variable_scale = factors.variable;
  p.equality_scale = factors.equality;
  p.row_scale = factors.row;
  p.cost_scale = factors.cost;
  p.sizes = sizes;
  state_->strategy.forget_scaling();
  take(all_numbers);
  state_->has_new_matrices = state_->is_rescaled = false;
  const SolveControls controls;
  Run run(state_->options, controls);
  state_->kkt->attend(run.interrupt());
  static_cast<void>(state_->strategy.decide_convexity(run));
  state_->kkt->attend({});
}

// Takes an element's numbers as if it were the first one after return_to_setup().
void Solver::take_element(const ProblemUpdate& checked, const ProblemUpdate& all_numbers) {
  if (state_->is_rescaled) return_to_setup(all_numbers);
  state_->problem.sizes = state_->first_scaling->sizes;
  state_->strategy.forget_unfinished();
  take(checked);
  fit_scaling();
}

void Solver::load_matrices() {
  state_->kkt->load(state_->problem);
  state_->strategy.forget_matrices();
}

Expected<void> Solver::set_options(const Options& options) {
  MARBLE_RETURN_IF_ERROR(validate_with(state_->methods, options));
  take(options);
  return {};
}

void Solver::take(const Options& checked) {
  const int scaling_passes = state_->options.scaling_passes;
  const Options now = in_force(checked);
  if (change_method(state_->options, now)) state_->strategy.forget_unfinished();
  state_->options = now;
  state_->options.scaling_passes = scaling_passes;
}

void Solver::keep_tree() { state_->strategy.keep_tree(); }
void Solver::shift_tree(const Shift& by) { state_->strategy.shift_tree(by); }

std::int64_t Solver::memory_bytes() const { return state_->memory_bytes; }

Expected<Solution> Solver::solve(const SolveControls& controls) {
  return solve(controls, false, !controls.initial_z.empty() && controls.warm_start == nullptr);
}

// near: solutions of similar problems with the sizes of this one, checked by the caller; the nearest one
// first.
Expected<Solution> Solver::solve(const SolveControls& controls, bool resumes, bool keeps_start,
                                 std::span<const Solution* const> near, bool compares_more) {
  MARBLE_RETURN_IF_ERROR(Problem::check_initial_point(controls.initial_z, state_->problem.variables()));
  if (controls.warm_start != nullptr) {
    MARBLE_RETURN_IF_ERROR(check_warm_start(*controls.warm_start, state_->sizes));
  }
  if (controls.sensitivity != nullptr) {
    if (auto valid = check(*controls.sensitivity, state_->sizes); !valid)
      return unexpected(inside("sensitivity", valid.error()));
  }
  if (controls.activity != nullptr) controls.activity->begin();
  if (controls.proof != nullptr) clear_leaves(*controls.proof);
  Run run(state_->options, controls);
  run.bytes_left = state_->bytes_left;
  state_->kkt->attend(run.interrupt());
  state_->initial_z.setZero();
  if (!controls.initial_z.empty()) {
    const Eigen::Map<const Vector> z(controls.initial_z.data(), state_->problem.variables());
    state_->initial_z = z.cwiseQuotient(state_->problem.variable_scale);
  }
  std::optional<Strategy::WarmStart> warm_start;
  if (controls.warm_start != nullptr) {
    marble::take(state_->problem, *controls.warm_start, state_->warm_start);
    warm_start = Strategy::WarmStart{&state_->warm_start, controls.warm_start->reference_objective};
  }
  const bool too_far = !bears(state_->initial_z) || (warm_start && !bears(state_->warm_start.all));
  if (too_far) {
    state_->initial_z.setZero();
    warm_start.reset();
  }
  std::size_t used = 0;
  for (const Solution* solution : near) {
    if (used == state_->near.size()) state_->near.emplace_back(state_->problem);
    marble::take(state_->problem, *solution, state_->near[used]);
    if (bears(state_->near[used].all)) ++used;
  }
  Strategy::Answer found = state_->strategy.run(run, state_->initial_z, warm_start,
                                                {.resumes = resumes && !too_far,
                                                 .keeps_start = keeps_start && !too_far,
                                                 .near = std::span(state_->near).first(used),
                                                 .compares_more = compares_more});
  Solution solution = answer(state_->problem, state_->options, found.ending, *found.x, run);
  const auto is_refused = [&] {
    return solution.status != found.ending.status && solution.status != Status::almost_solved;
  };
  const bool started = warm_start || used > 0 || max_abs(state_->initial_z) > 0.0;
  const bool again = is_refused() && started && !run.interrupted();
  if (again) {
    state_->initial_z.setZero();
    found = state_->strategy.run(run, state_->initial_z, std::nullopt, {});
    solution = answer(state_->problem, state_->options, found.ending, *found.x, run);
  }
  if (again || too_far) solution.detail += "; the start was too far away: it began at 0";
  if (is_refused()) found = {{solution.status, solution.detail, {}}, found.x};
  solution.b_stationary = found.b_stationary;
  take_proof(found, solution);
  if (is_solved(solution.status)) {
    const bool stationary =
        solution.stationarity == Stationarity::strong || solution.b_stationary.value_or(false);
    solution.second_order = found.second_order;
    if (solution.second_order == SecondOrder::minimum) {
      if (!stationary)
        solution.second_order = SecondOrder::necessary;
      else if (state_->strategy.known_convex())
        solution.second_order = SecondOrder::convex;
    }
    if (run.nonconvex) solution.detail += nonconvex_remark(solution.second_order);
  }
  if (controls.sensitivity != nullptr) state_->add_sensitivity(found, *controls.sensitivity, run, solution);
  if (controls.proof != nullptr) conclude(*controls.proof, state_->problem, solution);
  solution.times.setup_s = state_->setup_s;
  const bool keeps_reference = found.stayed_warm && !found.has_searched;
  solution.reference_objective =
      keeps_reference ? controls.warm_start->reference_objective : solution.objective;
  state_->kkt->attend({});  // the stop token and the pause of this solve may not exist during the next one
  return solution;
}

bool Solver::is_unfinished() const { return state_->strategy.is_unfinished(); }
void Solver::forget_unfinished() { state_->strategy.forget_unfinished(); }

bool Solver::is_feasible(const Solution& solution) const {
  return within_tolerances(solution.violations, state_->options);
}

// For a solve that ended early: the previous solution is better if it is feasible with the current numbers,
// and the point of this solve is infeasible or higher.
bool Solver::take_better(const Solution& previous, Solution& solution) const {
  const ScaledProblem& problem = state_->problem;
  Iterate x(problem);
  marble::take(problem, previous, x);
  if (!bears(x.all)) return false;
  Images images(problem);
  Solution moved;
  take_point(problem, x, images, moved);
  if (!is_finite(moved) || !within_tolerances(moved.violations, state_->options)) return false;
  if (is_feasible(solution) && solution.objective <= moved.objective) return false;
  solution.z = std::move(moved.z);
  solution.equality_multipliers = std::move(moved.equality_multipliers);
  solution.inequality_multipliers = std::move(moved.inequality_multipliers);
  solution.complementarity_multipliers_L = std::move(moved.complementarity_multipliers_L);
  solution.complementarity_multipliers_R = std::move(moved.complementarity_multipliers_R);
  solution.objective = moved.objective;
  solution.violations = moved.violations;
  solution.kkt_residual = moved.kkt_residual;
  solution.b_stationary.reset();
  solution.origin = PointOrigin::previous;
  return true;
}

// The warm start is this solver's own solution, so its sizes fit.
void Solver::prepare(const Solution& warm_start, const SolveControls& controls) {
  Run run(state_->options, controls);
  state_->kkt->attend(run.interrupt());
  marble::take(state_->problem, warm_start, state_->warm_start);
  state_->strategy.prepare(run, {&state_->warm_start, warm_start.reference_objective});
  state_->kkt->attend({});
}

Expected<Solution> solve_once(const Problem& problem, const Options& options, const SolveControls& controls,
                              const SetupControls& setup, const std::function<void(const Solver&)>& ready) {
  MARBLE_RETURN_IF_ERROR(Problem::check_initial_point(controls.initial_z, problem.variables()));
  if (controls.warm_start != nullptr) {
    MARBLE_RETURN_IF_ERROR(check_warm_start(*controls.warm_start, PartSizes::of(problem)));
  }
  SolveControls own = controls;
  if (!own.begun) own.begun = Interrupt::now(controls.pause);
  SetupControls limits = setup;
  limits.stop = controls.stop;
  limits.pause = controls.pause;
  limits.until = after(*own.begun, options.time_limit_s);
  auto solver = Solver::create(problem, options, limits);
  if (solver) {
    if (ready) ready(*solver);
    auto solution = solver->solve(own);
    if (solution && options.explain) explain(problem, options, own, limits, *solution);
    return solution;
  }
  const bool stopped = solver.error().code == ErrorCode::cancelled;
  if (!stopped && solver.error().code != ErrorCode::deadline_exceeded) return unexpected(solver.error());
  const ScaledProblem unscaled = scale(problem, 0);
  Iterate x(unscaled);
  x.all.setZero();
  if (!controls.initial_z.empty()) x.z() = Eigen::Map<const Vector>(controls.initial_z.data(), x.z().size());
  if (controls.warm_start != nullptr) take(unscaled, *controls.warm_start, x);
  Solution solution =
      answer(unscaled, options, {stopped ? Status::cancelled : Status::time_limit, solver.error().bound, {}},
             x, Run(options, own));
  solution.times.setup_s = std::chrono::duration<double>(Interrupt::now(controls.pause) - *own.begun).count();
  solution.times.solve_s = 0.0;
  solution.reference_objective = solution.objective;
  if (controls.sensitivity != nullptr)
    solution.sensitivity = unexpected(must_be_solved(solution.status).error());
  return solution;
}

Expected<Solution> solve_in_process(const ProblemView& view, const Options& options,
                                    const SolveControls& controls) {
  MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(view));
  return solve_once(problem, options, controls);
}

}  // namespace marble
