// One control step after the other: numbers for the LCQP, a rolled-out start, and the choice of the plan.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "lcs/assembly.h"
#include "lcs/check.h"
#include "lcs/dense.h"
#include "lcs/rollout.h"
#include "lcs/task.h"
#include "marble/lcs.h"
#include "marble/warm_solver.h"
#include "model/text_of.h"
#include "model/tolerances.h"
#include "model/tuning.h"

namespace marble {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// A trajectory with what the choice of a plan depends on.
struct Candidate {
  LcsTrajectory trajectory;
  bool exists = false;
  bool feasible = false;
  Violations violations;
  double objective = 0.0;
  std::string problem;  // why it does not exist or is not feasible
};

// Moves `by` stages on; the last stage takes the place of those that are missing.
void shift_stages(std::vector<double>& values, std::size_t width, std::size_t by) {
  const std::size_t stages = values.size() / width;
  if (by == 0) return;
  for (std::size_t k = 0; k < stages; ++k) {
    const std::size_t from = std::min(k + by, stages - 1);
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(from * width), width,
                values.begin() + static_cast<std::ptrdiff_t>(k * width));
  }
}

}  // namespace

const char* to_string(PlanOrigin origin) {
  switch (origin) {
    case PlanOrigin::solve:
      return "solve";
    case PlanOrigin::solve_rollout:
      return "solve_rollout";
    default:
      return "start_rollout";
  }
}

struct LcsPlanner::State {
  State(LCS system, CheckedTask checked, const Options& given)
      : lcs(std::move(system)), task(std::move(checked)), options(given), assembly(task) {
    for (Candidate* one : {&start, &solved, &repaired}) {
      one->trajectory.x.assign(product(task.stages + 1, task.states), 0.0);
      one->trajectory.u.assign(product(task.stages, task.inputs), 0.0);
      one->trajectory.lam.assign(product(task.stages, task.pairs), 0.0);
    }
    x0.assign(static_cast<std::size_t>(task.states), 0.0);
    last_u.assign(static_cast<std::size_t>(task.inputs), 0.0);
    start_z.assign(assembly.problem().g.size(), 0.0);
    assembly.set_matrices(lcs);
    write_vectors();
    one_stage = *Shift::by_stage(assembly.problem().view(), task.stages);
  }

  [[nodiscard]] Expected<void> check(const LcsStep& step, bool needs_state) const;
  [[nodiscard]] Expected<LcsUpdate> take(const LcsStep& step, bool prepares);
  void move_on(Index shift);
  void write_vectors();
  void roll_out(Candidate& candidate);
  void judge(Candidate& candidate);
  [[nodiscard]] LcsUpdate update(Index shift) const;
  [[nodiscard]] std::pair<const Candidate*, PlanOrigin> choose(Status status);

  LCS lcs;
  CheckedTask task;
  Options options;
  LcsAssembly assembly;
  Rollout rollout;
  Shift one_stage;
  Candidate start, solved, repaired;
  std::vector<double> x0, last_u, start_z;
  LcsTrajectory plan;  // the last one, shifted by the step under way; empty before the first
  bool is_prepared = false, is_begun = false;
  bool goes_on = false;                                 // the solve, from where the last one was cut off
  bool has_new_matrices = false, has_new_costs = true;  // since the last plan
  double assembly_s = 0.0, rollout_s = 0.0;
};

Expected<void> LcsPlanner::State::check(const LcsStep& step, bool needs_state) const {
  const auto nx = static_cast<std::size_t>(task.states), nu = static_cast<std::size_t>(task.inputs);
  Expected<void> valid;
  if (needs_state || !step.x0.empty()) valid = check_numbers(step.x0, nx, "x0");
  if (valid && !step.last_u.empty()) valid = check_numbers(step.last_u, nu, "last_u");
  if (valid) valid = task.check_targets(step.x_ref, step.u_ref);
  if (!valid) return valid;
  if (!step.u.empty()) {
    const std::size_t size = start.trajectory.u.size();
    if (step.u.size() != size) {
      return unexpected(invalid("u", std::to_string(step.u.size()),
                                "must have " + std::to_string(size) + " entries (stages times inputs)"));
    }
    MARBLE_RETURN_IF_ERROR(check_stages(step.u, nu, "u"));
  }
  if (step.shift < 0 || step.shift > task.stages) {
    return unexpected(invalid("shift", std::to_string(step.shift),
                              "must be in [0, " + std::to_string(task.stages) + "] (stages)"));
  }
  return {};
}

// The last plan moves on, and its inputs before the new stage 0 have been applied.
void LcsPlanner::State::move_on(Index shift) {
  if (plan.u.empty() || shift == 0) return;
  const auto nx = static_cast<std::size_t>(task.states), nu = static_cast<std::size_t>(task.inputs);
  const auto by = static_cast<std::size_t>(shift);
  std::copy_n(plan.u.begin() + static_cast<std::ptrdiff_t>((by - 1) * nu), nu, last_u.begin());
  shift_stages(plan.u, nu, by);
  shift_stages(plan.x, nx, by);
}

void LcsPlanner::State::write_vectors() {
  assembly.set_state(lcs, x0);
  assembly.set_costs(task, x0, last_u);
  assembly.set_limits(task, last_u);
}

void LcsPlanner::State::judge(Candidate& candidate) {
  candidate.exists = true;
  std::string where;
  candidate.violations = task.violations(lcs, candidate.trajectory, last_u, &where);
  candidate.objective = task.objective(candidate.trajectory, last_u);
  candidate.feasible = std::isfinite(candidate.objective) && within_tolerances(candidate.violations, options);
  candidate.problem.clear();
  if (candidate.feasible) return;
  const Violations& v = candidate.violations;
  candidate.problem = "dynamics are violated by " + general(v.equality, 3) + ", complementarity by " +
                      general(v.complementarity, 3);
  if (v.inequality > options.inequality_tolerance) candidate.problem += ", " + where;
}

// From the candidate's inputs.
void LcsPlanner::State::roll_out(Candidate& candidate) {
  const Clock::time_point begin = Clock::now();
  LcsTrajectory& trajectory = candidate.trajectory;
  task.clip(trajectory.u, last_u);
  std::ranges::copy(x0, trajectory.x.begin());
  if (auto simulated = rollout.run(lcs, trajectory)) {
    judge(candidate);
  } else {
    candidate.exists = candidate.feasible = false;
    candidate.problem = simulated.error().message();
  }
  rollout_s += seconds_since(begin);
}

LcsUpdate LcsPlanner::State::update(Index shift) const {
  const OwnedProblem& p = assembly.problem();
  LcsUpdate made;
  made.numbers = {.c0 = p.c0, .b = p.b, .r = p.r};
  if (has_new_costs || !task.R_change.empty()) made.numbers.g = p.g;
  if (!p.d.empty()) made.numbers.d = p.d;
  if (has_new_matrices) made.numbers.A = p.A.values, made.numbers.R = p.R.values;
  if (start.exists && !goes_on) made.restart.initial_z = start_z;
  if (shift == 0 || plan.u.empty()) return made;
  made.restart.shift = one_stage;
  for (auto* blocks : {&made.restart.shift.variables, &made.restart.shift.equalities,
                       &made.restart.shift.inequalities, &made.restart.shift.pairs}) {
    for (ShiftBlock& block : *blocks) block.by *= shift;
  }
  return made;
}

Expected<LcsUpdate> LcsPlanner::State::take(const LcsStep& step, bool prepares) {
  MARBLE_RETURN_IF_ERROR(check(step, !prepares));
  std::optional<LcsLimits> limits;
  if (!step.x_lb.empty() || !step.x_ub.empty() || !step.u_lb.empty() || !step.u_ub.empty()) {
    MARBLE_ASSIGN_OR_RETURN(limits, task.limits_after(step));
  }
  if (step.lcs != nullptr) {
    const LcsView& next = *step.lcs;
    for (const auto& [field, size, wanted] :
         {std::tuple{"states", next.states, task.states}, std::tuple{"inputs", next.inputs, task.inputs},
          std::tuple{"pairs", next.pairs, task.pairs}}) {
      if (size == wanted) continue;
      return unexpected(invalid(std::string("lcs.") + field, std::to_string(size),
                                "must be " + std::to_string(wanted) + ", as at the beginning"));
    }
    auto checked = LCS::create(next);
    if (!checked) return unexpected(inside("lcs", checked.error()));
    if (checked->stages() > 0 && checked->stages() != task.stages) {
      return unexpected(invalid("lcs.stages", std::to_string(checked->stages()),
                                "must be " + std::to_string(task.stages) + ", or constant"));
    }
    lcs = *std::move(checked);
  }
  const Clock::time_point begin = Clock::now();
  if (limits) task.limits = *std::move(limits);
  if (step.lcs != nullptr) {
    assembly.set_matrices(lcs);
    has_new_matrices = true;
  }
  if (!step.x_ref.empty() || !step.u_ref.empty()) {
    task.set_targets(step.x_ref, step.u_ref);
    has_new_costs = true;
  }
  const Index shift = is_prepared ? 0 : step.shift;
  move_on(shift);
  if (!step.last_u.empty()) std::ranges::copy(step.last_u, last_u.begin());
  if (!step.x0.empty()) {
    std::ranges::copy(step.x0, x0.begin());
  } else if (!plan.x.empty()) {
    std::copy_n(plan.x.begin(), x0.size(), x0.begin());
  }
  write_vectors();
  assembly_s = (is_prepared ? assembly_s : 0.0) + seconds_since(begin);
  if (!is_prepared) rollout_s = 0.0;
  std::ranges::copy(!step.u.empty() ? step.u : std::span<const double>(plan.u.empty() ? task.u_ref : plan.u),
                    start.trajectory.u.begin());
  roll_out(start);
  if (start.exists) assembly.join(start.trajectory, start_z);
  is_prepared = prepares;
  is_begun = !prepares;
  LcsUpdate made = update(shift);
  if (prepares) has_new_matrices = has_new_costs = false;
  return made;
}

// A plan is feasible if there is a feasible one, and not above the start.
std::pair<const Candidate*, PlanOrigin> LcsPlanner::State::choose(Status status) {
  const auto noise = [](const Candidate& one) { return tuning::exactness * (1.0 + std::abs(one.objective)); };
  if (solved.feasible && (!start.feasible || solved.objective <= start.objective + noise(start)))
    return {&solved, PlanOrigin::solve};
  if (!solved.feasible && solved.exists) {
    repaired.trajectory.u = solved.trajectory.u;
    roll_out(repaired);
    if (repaired.feasible && (!start.feasible || repaired.objective <= start.objective))
      return {&repaired, PlanOrigin::solve_rollout};
  }
  if (start.feasible || (start.exists && !is_solved(status))) return {&start, PlanOrigin::start_rollout};
  return {&solved, PlanOrigin::solve};
}

LcsPlanner::LcsPlanner(std::unique_ptr<State> state) : state_(std::move(state)) {}
LcsPlanner::LcsPlanner(LcsPlanner&&) noexcept = default;
LcsPlanner& LcsPlanner::operator=(LcsPlanner&&) noexcept = default;
LcsPlanner::~LcsPlanner() = default;

Expected<LcsPlanner> LcsPlanner::create(const LcsView& lcs, const LcsTask& task, const Options& options) {
  MARBLE_ASSIGN_OR_RETURN(auto system, LCS::create(lcs));
  MARBLE_ASSIGN_OR_RETURN(auto checked, CheckedTask::create(system, task));
  MARBLE_RETURN_IF_ERROR(validate(options));
  return LcsPlanner(std::make_unique<State>(std::move(system), std::move(checked), options));
}

ProblemView LcsPlanner::problem() const { return state_->assembly.problem().view(); }

std::span<const double> LcsPlanner::terminal_cost() const { return state_->task.P; }

Expected<LcsUpdate> LcsPlanner::begin(const LcsStep& step) { return state_->take(step, false); }

Expected<LcsUpdate> LcsPlanner::prepare(const LcsStep& step) { return state_->take(step, true); }

void LcsPlanner::resend() { state_->has_new_matrices = state_->has_new_costs = true; }

Expected<LcsPlan> LcsPlanner::finish(const LcsAnswer& answer) {
  State& s = *state_;
  if (!s.is_begun) return unexpected(failure(ErrorCode::failed_precondition, "a step must have begun"));
  if (!answer.z.empty() && answer.z.size() != s.start_z.size()) {
    return unexpected(invalid("z", std::to_string(answer.z.size()),
                              "must have " + std::to_string(s.start_z.size()) + " entries"));
  }
  s.solved.exists = s.solved.feasible = false;
  if (!answer.z.empty() && std::ranges::all_of(answer.z, [](double value) { return std::isfinite(value); })) {
    std::ranges::copy(s.x0, s.solved.trajectory.x.begin());
    s.assembly.split(answer.z, s.solved.trajectory);
    s.judge(s.solved);
  }
  const auto [chosen, origin] = s.choose(answer.status);
  LcsPlan plan;
  static_cast<LcsTrajectory&>(plan) = chosen->trajectory;
  plan.objective = chosen->objective;
  plan.status = answer.status;
  plan.origin = origin;
  plan.feasible = chosen->feasible;
  plan.violations = chosen->violations;
  if (s.start.feasible) plan.start_objective = s.start.objective;
  plan.detail = answer.detail;
  const auto add = [&](const std::string& what, const std::string& why) {
    plan.detail += (plan.detail.empty() ? "" : "; ") + what + why;
  };
  if (!s.start.feasible) add("the rolled-out start is not feasible: ", s.start.problem);
  if (!plan.feasible && origin == PlanOrigin::solve) add("the solution is not feasible: ", s.solved.problem);
  plan.assembly_s = s.assembly_s, plan.rollout_s = s.rollout_s;
  plan.times = answer.times;
  if (chosen->exists) s.plan = chosen->trajectory;
  // From a start, a solve would begin again in every step; without one, it may never be near a solution
  // again.
  const bool cut_off = answer.status == Status::time_limit || answer.status == Status::cancelled;
  s.goes_on = cut_off && !s.goes_on;
  s.is_begun = s.is_prepared = s.has_new_matrices = s.has_new_costs = false;
  return plan;
}

Expected<LcsPlan> LcsPlanner::step(WarmSolver& solver, const LcsStep& step, const SolveControls& controls) {
  MARBLE_ASSIGN_OR_RETURN(auto update, begin(step));
  MARBLE_ASSIGN_OR_RETURN(auto solution, solver.solve(update.numbers, update.restart, controls));
  return finish({.status = solution.status,
                 .z = solution.z,
                 .detail = std::move(solution.detail),
                 .times = solution.times});
}

}  // namespace marble
