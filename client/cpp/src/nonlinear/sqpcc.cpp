#include "nonlinear/sqpcc.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <utility>

#include "nonlinear/algebra.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

bool of_other_size(const Sizes& before, const Sizes& now, bool solved) {
  const auto other = [](double one, double two) {
    return std::max(one, two) > tuning::other_size * std::min(one, two);
  };
  if (solved && other(before.slope, now.slope)) return true;
  const double none = tuning::no_size * std::max(largest(before.curvature), largest(now.curvature));
  for (std::size_t j = 0; j < now.curvature.size(); ++j)
    if (other(std::max(before.curvature[j], none), std::max(now.curvature[j], none))) return true;
  return false;
}

}  // namespace

Expected<Answer> Loop::run(const std::optional<LevelTolerance>& tolerance) {
  MARBLE_RETURN_IF_ERROR(B_ ? begin_again() : begin());
  for (row_.iteration = 0;; ++row_.iteration) {
    if (row_.iteration >= settings_.iteration_limit) return end(Status::iteration_limit, "iteration_limit");
    // one LCQP; more if it must be elastic or convex
    MARBLE_ASSIGN_OR_RETURN(auto found, find_step());
    if (limit_) return end(*limit_, "within a subproblem");
    if (stuck_) return end(Status::locally_infeasible, "no step lowers the violation");
    const double share = B_->learns() && stalled_ == 0 ? tuning::learnt_share * stationary_ : stationary_;
    if (found && step_is_small() && is_stationary(share) && violation() <= settings_.feasibility_tolerance &&
        radius_ > settings_.step_tolerance) {
      // d = 0 solves the linearized problem
      MARBLE_ASSIGN_OR_RETURN(auto sure, certified());
      if (sure && is_stationary(stationary_)) return end(Status::solved, "the step is zero");
    }
    if (found && meets(tolerance)) {
      Answer answer = end(Status::solved, "the level's tolerance is met");
      answer.b_stationary.reset(), answer.stationarity = Stationarity::unknown;  // they belong to d = 0
      return answer;
    }
    ratio_ = -1.0, actual_ = 0.0;
    if (found) {
      MARBLE_RETURN_IF_ERROR(judge());
      MARBLE_RETURN_IF_ERROR(lengthen());
      if (ratio_ < tuning::poor && !step_.elastic) {
        MARBLE_RETURN_IF_ERROR(correct());
      }
    }
    MARBLE_ASSIGN_OR_RETURN(row_.accepted, linearised());
    report();
    adapt_radius();
    if (found && stalls()) return end_of_zero_steps();
    if (row_.accepted) {
      MARBLE_RETURN_IF_ERROR(move());
    } else if (radius_ <= tuning::least_radius) {
      return end_of_small_radius();
    }
  }
}

Expected<void> Loop::begin() {
  point_.x.assign(functions_.start().begin(), functions_.start().end());
  MARBLE_RETURN_IF_ERROR(evaluate_start());
  trial_ = best_trial_ = point_, next_ = at_;  // allocates their memory
  Multipliers& m = step_.multipliers;
  m.equalities.assign(point_.equalities.size(), 0.0), m.inequalities.assign(point_.inequalities.size(), 0.0);
  m.G.assign(point_.G.size(), 0.0), m.H.assign(point_.H.size(), 0.0), m.bounds.assign(point_.x.size(), 0.0);
  step_.d.assign(point_.x.size(), 0.0), no_step_ = step_.d;
  gradient_.resize(point_.x.size()), change_.resize(point_.x.size());
  weights_.emplace(rows_of(point_), tuning::first_weight);
  radius_ = settings_.radius;
  return make_curvature();
}

// If values are not finite, as those of a root at a bound: starts slightly inside the bounds.
Expected<void> Loop::evaluate_start() {
  std::optional<Error> first;
  for (bool inside = false;; inside = true) {
    MARBLE_RETURN_IF_ERROR(functions_.values(point_));
    if (!point_.fault) {
      MARBLE_RETURN_IF_ERROR(functions_.derivatives(point_, at_));
    }
    const std::optional<Error>& fault = point_.fault ? point_.fault : at_.fault;
    if (!fault) return {};
    if (!first) first = fault;
    if (inside || !functions_.leave_bounds(point_.x)) return unexpected(*first);
  }
}

// The functions have changed, and so has B, except that of bfgs, which needs a step.
Expected<void> Loop::begin_again() {
  MARBLE_RETURN_IF_ERROR(functions_.values(point_));
  if (point_.fault) return unexpected(*point_.fault);
  MARBLE_RETURN_IF_ERROR(functions_.derivatives(point_, at_));
  if (at_.fault) return unexpected(*at_.fault);
  restoring_ = stuck_ = false, stalled_ = restarts_ = 0,
  leapt_from_ = std::numeric_limits<double>::infinity();
  limit_.reset();
  answer_.b_stationary.reset(), answer_.stationarity = Stationarity::unknown;
  if (radius_ <= settings_.step_tolerance) radius_ = settings_.radius;
  if (std::exchange(forget_curvature_, false)) return make_curvature();
  std::fill(step_.d.begin(), step_.d.end(), 0.0), std::fill(change_.begin(), change_.end(), 0.0);
  return B_->move(functions_, point_, at_, step_.multipliers, step_.d, change_);
}

Expected<void> Loop::make_curvature() {
  const Curvature kind =
      settings_.method == Method::slp ? Curvature::none : chosen(settings_.curvature, problem_, point_);
  if (kind == Curvature::exact && !problem_.hessian)
    return unexpected(invalid("hessian", "must be a function: the settings ask for the exact curvature"));
  MARBLE_ASSIGN_OR_RETURN(B_, Model::create(kind, functions_, point_, at_, step_.multipliers));
  return {};
}

// Returns true if there is a step to evaluate. Tries the plain subproblem first, at the start within wider
// radii too; if it is infeasible, the elastic one; and if that cannot lower the violation whatever its
// weights, the violation alone.
Expected<bool> Loop::find_step() {
  row_.corrected = leap_ = false;
  if (!restoring_) {
    auto found = ask(Kind::plain);
    if (!found || limit_) return found;
    if (!*found && row_.iteration == 0) {
      found = ask_wider();
      if (!found || limit_) return found;
    }
    if (*found) {
      weights_->rise_above(step_.multipliers);
      return convex_enough();
    }
    return find_elastic_step();
  }
  return find_restoring_step();
}

// The first radius is a guess: if it excludes every point that meets the linearized rows, a wider one may
// not. The merit still judges the step.
Expected<bool> Loop::ask_wider() {
  const double first = radius_;
  for (int tries = 0; tries < tuning::most_widenings && radius_ < settings_.largest_radius; ++tries) {
    radius_ = std::min(tuning::growth * radius_, settings_.largest_radius);
    auto found = ask(Kind::plain);
    if (!found || limit_ || *found) return found;
  }
  radius_ = first;
  return false;
}

Expected<bool> Loop::find_elastic_step() {
  for (int rises = 0;; ++rises) {
    auto found = ask(Kind::elastic);
    if (!found || limit_ || !*found) return found;
    const double before = largest_violation(rows_of(point_)), after = largest_violation(step_.rows());
    if (after <= std::max(tuning::violation_left * before, settings_.feasibility_tolerance)) break;
    if (rises == tuning::most_rises || weights_->most() >= tuning::most_weight) {
      restoring_ = true;
      restore_below_ = tuning::restored * before;
      return find_restoring_step();
    }
    weights_->multiply(tuning::growth);
  }
  return convex_enough();
}

Expected<bool> Loop::find_restoring_step() {
  *weights_ = Weights(rows_of(point_), tuning::first_weight);
  auto found = ask(Kind::elastic);
  if (!found || limit_ || !*found) return found;
  predicted_ = predicted_decrease();
  stuck_ = predicted_ <= settings_.feasibility_tolerance * std::min(1.0, radius_);
  return stuck_ ? find_leap() : true;
}

// No short step lowers the violation. A long one may, to another branch of the pairs, although the rows are
// curved on the way: it is accepted as it is, and the steps after it must end with a lower violation than
// here.
Expected<bool> Loop::find_leap() {
  const double here = merit(point_), short_radius = radius_;
  if (here >= leapt_from_) return go_back();
  if (here > tuning::violation_left * leapt_from_) return true;
  leapt_from_ = here, least_ = point_.x;
  while (radius_ < settings_.largest_radius) {
    radius_ = std::min(tuning::growth * radius_, settings_.largest_radius);
    auto found = ask(Kind::elastic, true);
    if (!found || limit_ || !*found) return found;
    predicted_ = predicted_decrease();
    leap_ = predicted_ > (1.0 - tuning::violation_left) * here;
    if (leap_) return stuck_ = false, true;
  }
  radius_ = short_radius;
  return true;
}

Expected<bool> Loop::go_back() {
  point_.x = least_;
  MARBLE_RETURN_IF_ERROR(functions_.values(point_));
  MARBLE_RETURN_IF_ERROR(functions_.derivatives(point_, at_));
  return true;
}

// If the curvature prevents descent along the step, adds to the diagonal until the step is a descent.
Expected<bool> Loop::convex_enough() {
  for (int shifts = 0;; ++shifts) {
    predicted_ = predicted_decrease();
    const bool good = step_is_small() || (predicted_ > 0.0 && step_.second_order != SecondOrder::saddle);
    if (good || shifts == tuning::most_shifts) return good;
    B_->shift(std::max(tuning::growth * B_->shift(),
                       tuning::first_shift * std::max(1.0, largest(B_->upper().values))));
    auto found = ask(step_.elastic ? Kind::elastic : Kind::plain);
    if (!found || limit_ || !*found) return found;
    if (!step_.elastic) weights_->rise_above(step_.multipliers);
  }
}

// The measure of a step that the radius cuts is that of the radius.
bool Loop::meets(const std::optional<LevelTolerance>& tolerance) {
  if (!tolerance) return false;
  const double measure = tolerance->test == LevelTest::merit ? predicted_ : step_.size;
  if (row_.iteration == 0) first_measure_ = measure;
  return !step_.elastic && !restoring_ && step_.size < (1.0 - tuning::rounding) * radius_ &&
         measure <= tolerance->reduction * first_measure_ + tolerance->floor;
}

// Solves the LCQP at the point, within the radius.
Expected<bool> Loop::ask(Kind kind, bool cold) {
  auto& subproblem = subproblem_[static_cast<int>(kind)];
  if (!subproblem) subproblem.emplace(at_, B_->upper(), kind == Kind::elastic);
  subproblem->set(point_, at_, B_->upper(), box());
  if (kind == Kind::elastic) subproblem->set_weights(*weights_);
  if (restoring_) subproblem->drop_objective();
  auto found = ask_prepared(kind, cold);
  if (!found || !*found) return found;
  std::swap(step_, tried_);
  return true;
}

// Solves one LCQP, or two if the session must be opened again or has lost the step 0, which is feasible
// whenever x is: a session continues from its last solution. Result in `tried_`; returns false if there is no
// feasible solution.
Expected<bool> Loop::ask_prepared(Kind kind, bool cold) {
  auto& subproblem = *subproblem_[static_cast<int>(kind)];
  auto& ticks = ticks_[static_cast<int>(kind)];
  auto& sizes = sizes_[static_cast<int>(kind)];  // at the set-up
  subproblem.sizes(new_sizes_);
  bool from_no_step = false;
  while (true) {
    if (settings_.stop.stop_requested()) limit_ = Status::cancelled;
    const double left = seconds_left();
    if (!limit_ && left <= 0.0) limit_ = Status::time_limit;
    if (limit_) return false;
    if (ticks == nullptr) {
      MARBLE_ASSIGN_OR_RETURN(ticks, open_(subproblem.view(), settings_));
      sizes = new_sizes_;
    }
    const std::span<const double> start = from_no_step ? no_step_ : std::span<const double>();
    auto solution = ticks->solve(subproblem.update(), {.cold = cold || from_no_step,
                                                       .deadline_s = left,
                                                       .progress = settings_.progress,
                                                       .initial_z = start});
    ++row_.ticks;
    if (!solution) {
      const ErrorCode code = solution.error().code;
      if (code == ErrorCode::deadline_exceeded) limit_ = Status::time_limit;
      if (code == ErrorCode::cancelled && settings_.stop.stop_requested()) limit_ = Status::cancelled;
      if (limit_) return false;
      return unexpected(solution.error());
    }
    answer_.factorizations += solution->factorizations;
    answer_status_ = solution->status;
    if (solution->status == Status::cancelled) limit_ = Status::cancelled;
    if (solution->status == Status::time_limit && left < settings_.lcqp.time_limit_s)
      limit_ = Status::time_limit;
    // A session may keep the scaling of its first numbers. If the current ones have other magnitudes, a step
    // may meet the scaled tolerances and be meaningless: it is solved again in a fresh session.
    if (!limit_ && solution->kkt_residual > tuning::bad_answer * std::max(1.0, new_sizes_.slope) &&
        of_other_size(sizes, new_sizes_, is_solved(solution->status))) {
      reopened_ += ticks->reopened();
      ticks.reset();
      continue;
    }
    if (kind == Kind::plain && !limit_ && !from_no_step && loses_no_step(subproblem, *solution)) {
      from_no_step = true;
      continue;
    }
    if (!is_solved(solution->status)) return false;
    subproblem.read(*solution, point_, at_, box(), tried_);
    return true;
  }
}

bool Loop::loses_no_step(const Subproblem& subproblem, const Solution& solution) const {
  const double cost = subproblem.cost_of_no_step();
  const bool loses =
      !is_solved(solution.status) ||
      !(solution.objective <= cost + tuning::lcqp_stationarity * std::max(1.0, std::abs(cost)));
  return loses && subproblem.allows_no_step(settings_.lcqp);
}

// A zero step that is not proven to solve the subproblem may be an artefact of the warm start: solves again
// from scratch. Returns whether the step stays zero.
Expected<bool> Loop::certified() {
  if (step_.b_stationary.value_or(false) || step_.elastic) return true;
  MARBLE_ASSIGN_OR_RETURN(auto found, ask(Kind::plain, true));
  if (!found || step_is_small()) return true;
  weights_->rise_above(step_.multipliers);
  predicted_ = predicted_decrease();
  if (predicted_ > noise()) return false;
  std::swap(step_, tried_);  // the zero step is as good, and has the multipliers of x
  step_.b_stationary = tried_.b_stationary, step_.stationarity = tried_.stationarity;
  return true;
}

// Returns whether the trial point is accepted: its merit is good, and it has derivatives.
Expected<bool> Loop::linearised() {
  if (ratio_ < tuning::reject && !(leap_ && !trial_.fault)) return false;
  MARBLE_RETURN_IF_ERROR(functions_.derivatives(trial_, next_));
  if (!next_.fault) return true;
  trial_.fault = next_.fault, ratio_ = -1.0;
  return false;
}

// Moves to the trial point, with the step's multipliers.
Expected<void> Loop::move() {
  const Multipliers& m = step_.multipliers;
  lagrangian_gradient(at_, m, change_);
  std::swap(point_, trial_), std::swap(at_, next_);
  lagrangian_gradient(at_, m, gradient_);
  for (std::size_t j = 0; j < change_.size(); ++j) change_[j] = gradient_[j] - change_[j];
  if (std::exchange(forget_curvature_, false)) return make_curvature();
  const double sigma = B_->shift() / tuning::growth;
  MARBLE_RETURN_IF_ERROR(B_->move(functions_, point_, at_, m, step_.d, change_));
  B_->shift(sigma > tuning::first_shift / tuning::growth ? sigma : 0.0);
  if (restoring_ && violation() <= std::max(restore_below_, settings_.feasibility_tolerance))
    restoring_ = false, leapt_from_ = std::numeric_limits<double>::infinity();
  return {};
}

void Loop::report() {
  if (!settings_.iteration) return;
  row_.objective = point_.objective, row_.violation = violation();
  row_.step = step_.size, row_.radius = radius_, row_.predicted = predicted_, row_.actual = actual_;
  row_.shift = B_->shift(), row_.elastic = step_.elastic, row_.restoring = restoring_;
  row_.x = point_.x;
  settings_.iteration(row_);
  row_.x = {};
}

Answer Loop::end_of_small_radius() {
  Answer answer =
      end(Status::numerical_failure, trial_.fault ? "every step ends where " + trial_.fault->message()
                                                  : "no step is good, however short");
  if (answer.violation <= settings_.feasibility_tolerance && is_stationary(kReducedKkt))
    answer.status = Status::almost_solved;
  return answer;
}

Answer Loop::end_of_zero_steps() {
  return is_stationary(kReducedKkt)
             ? end(Status::almost_solved, "the steps are zero, but x is only almost stationary")
             : end(Status::numerical_failure, "the steps are zero, but x is not stationary");
}

Answer Loop::end(Status status, const std::string& why) {
  answer_.status = status;
  answer_.x = point_.x, answer_.multipliers = step_.multipliers;
  answer_.objective = point_.objective, answer_.violation = violation();
  answer_.kkt_residual = kkt_residual();
  if (status == Status::solved)
    answer_.b_stationary = step_.b_stationary, answer_.stationarity = step_.stationarity;
  answer_.iterations = row_.iteration, answer_.ticks = row_.ticks,
  answer_.evaluations = functions_.evaluations();
  answer_.reopened = reopened_;
  for (const auto& ticks : ticks_) answer_.reopened += ticks != nullptr ? ticks->reopened() : 0;
  char text[200];
  std::snprintf(text, sizeof text,
                ": step %.1e within %.1e, violation %.1e, KKT residual %.1e after %d LCQPs", step_.size,
                radius_, answer_.violation, answer_.kkt_residual, row_.ticks);
  answer_.detail = why + text;
  if (const std::int32_t replaced = B_->replaced(); replaced > 0)
    answer_.detail += "; entries of " + std::to_string(replaced) +
                      (replaced == 1 ? " Hessian" : " Hessians") + " were not finite";
  return answer_;
}

Expected<void> check(const Settings& s) {
  if (auto valid = validate(s.lcqp); !valid) return unexpected(inside("settings.lcqp", valid.error()));
  const auto positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  for (const auto& [good, field, value] :
       {std::tuple{positive(s.step_tolerance), "settings.step_tolerance", s.step_tolerance},
        std::tuple{positive(s.feasibility_tolerance), "settings.feasibility_tolerance",
                   s.feasibility_tolerance},
        std::tuple{positive(s.radius), "settings.radius", s.radius},
        std::tuple{positive(s.time_limit_s), "settings.time_limit_s", s.time_limit_s}}) {
    if (!good) return unexpected(invalid(field, std::to_string(value), "must be finite and > 0"));
  }
  if (!(s.largest_radius >= s.radius))
    return unexpected(
        invalid("settings.largest_radius", std::to_string(s.largest_radius), "must be >= radius"));
  const bool none = s.curvature == Curvature::none;
  if (s.method == Method::slp ? !none && s.curvature != Curvature::automatic : none && is_reference(s.method))
    return unexpected(
        invalid("settings.curvature", none ? "must not be none of a reference method"
                                           : "must be automatic or none where the method is slp"));
  if (s.iteration_limit < 0)
    return unexpected(invalid("settings.iteration_limit", std::to_string(s.iteration_limit), "must be >= 0"));
  return {};
}

Expected<bool> Ticks::prepare(const ProblemUpdate& /*update*/, const TickControls& /*controls*/) {
  return false;
}

Options Settings::subproblem_options() {
  Options options;
  options.equality_tolerance = options.inequality_tolerance = options.complementarity_tolerance =
      tuning::lcqp_tolerance;
  options.stationarity_tolerance = tuning::lcqp_stationarity;
  return options;
}

}  // namespace marble::nonlinear
