#include "research/reference.h"

#include "model/text_of.h"
#include "research/aladin_beta.h"
#include "research/l1_barrier.h"
#include "research/l1_penalty.h"
#include "research/penalty_scp.h"
#include "research/quadratic_penalty.h"
#include "research/scholtes.h"
#include "research/tuning.h"

namespace marble {
namespace {

std::unique_ptr<ReferenceMethod> make(const ScaledProblem& problem, Kkt& kkt, const Options& options,
                                      BranchEngines& branch) {
  switch (options.method) {
    case Method::penalty_scp:
      return std::make_unique<PenaltyScp>(problem, kkt);
    case Method::relaxation:
      return std::make_unique<ScholtesRelaxation>(problem, kkt, options);
    case Method::l1_penalty:
      return std::make_unique<L1Penalty>(problem, kkt);
    case Method::exterior:
      return std::make_unique<ExteriorPenalty>(problem, options, branch);
    case Method::aladin_beta:
      return std::make_unique<AladinBeta>(problem, kkt, options);
    case Method::l1_barrier:
      return std::make_unique<L1Barrier>(problem, kkt, options, L1Barrier::Schedule::every_problem);
    case Method::l1_barrier_stepwise:
      return std::make_unique<L1Barrier>(problem, kkt, options, L1Barrier::Schedule::every_step);
    case Method::plain_barrier:
      return std::make_unique<L1Barrier>(problem, kkt, options, L1Barrier::Schedule::no_penalty);
    default:
      return std::make_unique<AugmentedLagrangian>(problem, branch);
  }
}

std::string name_of(Method method) {
  for (const OptionInfo& option : option_table()) {
    if (option.name == "method") return std::string(option.choices[static_cast<std::size_t>(method)]);
  }
  return {};
}

class Methods final : public ReferenceMethods {
 public:
  [[nodiscard]] std::unique_ptr<ReferenceSolve> create(const ScaledProblem& problem, Kkt& kkt,
                                                       const Options& options,
                                                       BranchEngines& branch) const override {
    return std::make_unique<Reference>(problem, kkt, options, branch);
  }
  // Counts a copy of the problem without pairs, its engines, and the best point.
  [[nodiscard]] double bytes(double entries, double iterate) const override {
    return entries * (sizeof(double) + 2.0 * sizeof(Index)) +
           tuning::memory_iterates * iterate * sizeof(double);
  }
};

}  // namespace

const ReferenceMethods& research::reference_methods() {
  static const Methods methods;
  return methods;
}

Expected<Solution> research::solve_in_process(const ProblemView& view, const Options& options,
                                              const SolveControls& controls) {
  MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(view));
  return solve_once(problem, options, controls, {.reference_methods = &reference_methods()});
}

Reference::Reference(const ScaledProblem& problem, Kkt& kkt, const Options& options, BranchEngines& branch)
    : problem_(problem),
      kkt_(kkt),
      options_(options),
      branch_(branch),
      x_(problem),
      best_(problem),
      images_(problem),
      reporter_(problem) {}

void Reference::take(const Iterate& x) {
  x_.z() = x.z();
  x_.y() = x.y();
  x_.lambda() = x.lambda();
  images_.evaluate(problem_, x_);
  violations_ = violations(problem_, images_);
}

Ending Reference::run(Run& run, ConstVectorRef initial_z) {
  if (method_ == nullptr || made_ != options_.method) method_ = make(problem_, kkt_, options_, branch_);
  made_ = options_.method;
  method_->start(initial_z);
  take(method_->iterate());
  best_.all = x_.all;
  best_violations_ = violations_;
  auto state = ReferenceMethod::State::going_on;
  while (state == ReferenceMethod::State::going_on) {
    reporter_.report(run, x_.z(), images_.objective, violations_,
                     {.kkt_residual = max_abs(images_.stationarity),
                      .kappa = method_->relaxation(),
                      .rho = method_->penalty()});
    if (largest(violations_) < largest(best_violations_)) {
      best_.all = x_.all;
      best_violations_ = violations_;
    }
    if (const auto reason = run.interrupted()) {
      take(best_);
      return {*reason, "stopped early; " + describe(violations_), {}};
    }
    state = method_->step(run);
    take(method_->iterate());
  }
  if (const auto reason = run.interrupted(); reason && state == ReferenceMethod::State::failed) {
    take(best_);
    return {*reason, "stopped early; " + describe(violations_), {}};
  }
  return judge(state);
}

Ending Reference::judge(ReferenceMethod::State state) const {
  using State = ReferenceMethod::State;
  const double residual = max_abs(images_.stationarity);
  const std::string where = "; scaled KKT residual " + scientific(residual, 2) + "; " + describe(violations_);
  const std::string remark = method_->remark();
  const std::string name = name_of(options_.method) + (remark.empty() ? "" : " (" + remark + ")");
  if (state != State::failed && within_tolerances(violations_, options_) &&
      residual <= options_.stationarity_tolerance)
    return {Status::solved, name + where, {}};
  if (within_tolerances(violations_, options_, tuning::reduced_factor) &&
      residual <= tuning::reduced_residual)
    return {Status::almost_solved, name + " came no nearer" + where, {}};
  if (state == State::given_up)
    return {Status::locally_infeasible, name + " gave up at its last penalty" + where, {}};
  return {Status::numerical_failure, name + " did not solve a problem on its way" + where, {}};
}

}  // namespace marble
