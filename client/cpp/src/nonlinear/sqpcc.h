// Provides the main loop: LCQPs within a trust region; steps are accepted by actual over predicted decrease
// of the merit.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "marble/retrospective.h"
#include "nonlinear/curvature.h"
#include "nonlinear/functions.h"
#include "nonlinear/merit.h"
#include "nonlinear/subproblem.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {

/// Ends a level before its steps are zero: the measure of a plain subproblem's step, which the radius does
/// not limit, is at most `reduction` times that of the level's first step, plus `floor`.
struct LevelTolerance {
  LevelTest test = LevelTest::merit;
  double reduction = 0.0;
  double floor = 0.0;
};

// The KKT residual of an almost stationary solution, relative to the largest slope.
inline constexpr double kReducedKkt = tuning::reduced_factor * tuning::solved_kkt;

/// Returns the scale of the terms that balance at a stationary point: max{1, |∇θ|, |multipliers|}.
[[nodiscard]] double largest_slope(const Linearisation& at, const Multipliers& m);
/// ∇θ + ∇c_Eᵀy − ∇c_Iᵀν − ∇Gᵀξ − ∇Hᵀη
void lagrangian_gradient(const Linearisation& at, const Multipliers& m, std::vector<double>& gradient);

[[nodiscard]] inline bool is_reference(Method method) {
  return method != Method::sqpcc && method != Method::slp;
}

/// Checks the settings of nonlinear::solve.
[[nodiscard]] Expected<void> check(const Settings& settings);

class Loop {
 public:
  /// All arguments but the functions must outlive it.
  Loop(const Problem& problem, Functions functions, const OpenTicks& open, const Settings& settings)
      : problem_(problem), functions_(std::move(functions)), open_(open), settings_(settings) {}

  /// Runs from the problem's start; later runs continue from where the last one ended, with its x,
  /// multipliers, B of bfgs, weights, radius and sessions. The functions may then be others with the same
  /// patterns. With `tolerance`, Status::solved means that it is met, or the settings' tolerances are.
  Expected<Answer> run(const std::optional<LevelTolerance>& tolerance = {});

  /// Sets the KKT residual of a solved status, relative to the largest slope.
  void set_stationary(double share) { stationary_ = share; }
  /// Resets B of bfgs to that of the start.
  void forget_curvature() { forget_curvature_ = true; }
  /// Returns the number of calls of Problem::derivatives so far.
  [[nodiscard]] std::int32_t linearisations() const { return functions_.linearisations(); }

 private:
  using Clock = std::chrono::steady_clock;
  enum class Kind { plain, elastic };

  Expected<void> begin();
  Expected<void> evaluate_start();
  Expected<void> begin_again();
  Expected<void> make_curvature();
  Expected<bool> find_step();
  Expected<bool> ask_wider();
  Expected<bool> find_elastic_step();
  Expected<bool> find_restoring_step();
  Expected<bool> find_leap();
  Expected<bool> go_back();
  Expected<bool> convex_enough();
  Expected<bool> ask(Kind kind, bool cold = false);
  Expected<bool> ask_prepared(Kind kind, bool cold = false);
  [[nodiscard]] bool loses_no_step(const Subproblem& subproblem, const Solution& solution) const;
  Expected<bool> certified();
  Expected<void> judge();
  Expected<void> correct();
  Expected<void> lengthen();
  Expected<bool> linearised();
  Expected<void> move();
  void adapt_radius();
  void report();
  Answer end(Status status, const std::string& why);
  Answer end_of_small_radius();
  Answer end_of_zero_steps();

  [[nodiscard]] double seconds_left() const {
    return settings_.time_limit_s - std::chrono::duration<double>(Clock::now() - begun_).count();
  }
  [[nodiscard]] Box box() const {
    return {functions_.lower(), functions_.upper(), functions_.scale(), radius_};
  }
  [[nodiscard]] double merit(const Point& point) const {
    return (restoring_ ? 0.0 : point.objective) + weights_->penalty(rows_of(point));
  }
  [[nodiscard]] double predicted_decrease() const;
  [[nodiscard]] bool step_is_small() const { return step_.size <= settings_.step_tolerance; }
  [[nodiscard]] bool is_stationary(double share);
  [[nodiscard]] bool stalls();
  [[nodiscard]] double noise() const { return tuning::rounding * std::max(1.0, std::abs(merit(point_))); }
  [[nodiscard]] double kkt_residual();
  [[nodiscard]] double violation() const { return largest_violation(rows_of(point_)); }
  [[nodiscard]] bool meets(const std::optional<LevelTolerance>& tolerance);

  const Problem& problem_;
  Functions functions_;
  const OpenTicks& open_;
  const Settings& settings_;
  Clock::time_point begun_ = Clock::now();

  Point point_, trial_, best_trial_;
  Linearisation at_, next_;  // at point_, and at the accepted trial
  std::optional<Model> B_;
  std::optional<Weights> weights_;
  std::optional<Subproblem> subproblem_[2];
  std::unique_ptr<Ticks> ticks_[2];
  Sizes sizes_[2], new_sizes_;  // when the sessions were opened, and now
  std::int32_t reopened_ = 0;   // of closed sessions
  Step step_, tried_;
  Status answer_status_ = Status::numerical_failure;
  std::optional<Status> limit_;  // ended an LCQP solve

  double radius_ = 0.0;
  double stationary_ = tuning::solved_kkt;
  int stalled_ = 0, restarts_ = 0;  // consecutive zero steps; resets of B of bfgs
  bool forget_curvature_ = false;
  double first_measure_ = 0.0;  // for the level's tolerance
  bool restoring_ = false;
  double restore_below_ = 0.0;
  bool leap_ = false;                                            // the current step is a leap
  double leapt_from_ = std::numeric_limits<double>::infinity();  // violation at the start of the last leap
  std::vector<double> least_;                                    // x of that violation
  bool stuck_ = false;                                           // no step lowers the violation
  double predicted_ = 0.0, actual_ = 0.0, ratio_ = 0.0;
  Iteration row_;
  Answer answer_;
  std::vector<double> gradient_, change_;
  std::vector<double> no_step_;  // d = 0
};

}  // namespace marble::nonlinear
