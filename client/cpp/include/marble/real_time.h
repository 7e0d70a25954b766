// Provides real-time iteration: a nonlinear plan in closed loop, with one LCQP per control step. The work
// that does not need the measurement is done before the measurement arrives.
//
//   auto loop = marble::nonlinear::RealTime::create(problem, {.variables = {0, 1}}, client,
//                                                  {.shift = one_stage});
//   for (;;) {
//     loop->prepare();                          // while the measurement is on its way
//     auto tick = loop->feedback(measurement);  // tick->x is the plan
//   }
//
// After Diehl, Bock and Schlöder, "A real-time iteration scheme for nonlinear optimization in optimal
// feedback control", SIAM J. Control Optim. 43 (2005), with an LCQP in place of the QP.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "marble/nonlinear.h"

namespace marble::nonlinear {

/// Where the measurement enters (initial-value embedding): linearly, so that everything else can be prepared
/// before it arrives.
struct Measured {
  /// Each of these is fixed at its entry of the measurement, whatever its bounds are.
  std::vector<Index> variables = {};
  /// Rows of c_E, each of which must equal its entry of the measurement instead of 0. Their entries follow
  /// those of the variables.
  std::vector<Index> equalities = {};
};

/// What a control step returns if its LCQP has no solution: because its deadline has passed, or because it is
/// infeasible.
enum class Fallback {
  keep,     ///< the plan that the last control step returned, unchanged
  shifted,  ///< the last plan, shifted
  /// The solution of the elastic LCQP, whose rows may each be violated at a cost, within the rest of the
  /// deadline. If that has no solution either, or the deadline has passed, the last plan, shifted.
  elastic,
};

/// What a control step returned.
enum class Outcome { answered, kept, shifted, elastic };

/// "answered", "kept", "shifted" or "elastic".
[[nodiscard]] const char* to_string(Outcome outcome);

/// All fields are optional.
struct RealTimeSettings {
  Curvature curvature = Curvature::automatic;  ///< not bfgs, which needs several steps per control step
  double diagonal = 0.0;                  ///< over scale², added to B's diagonal, ≥ 0: keeps steps short
  double radius = 1e6;                    ///< of steps, in units of scale, > 0
  Fallback fallback = Fallback::shifted;  ///< what a control step without a solution returns
  /// How the plan shifts between control steps: ranges of x, of c_E, of c_I and of the pairs. Empty: no
  /// shift.
  Shift shift = {};
  /// Called after the shift to complete it, for example with a better last stage.
  std::function<void(std::span<double> x)> moved = {};
  bool reopen = false;                            ///< as Settings::reopen
  ProgressSink* progress = nullptr;               ///< reports the progress of each control step
  std::stop_token stop = {};                      ///< ends the control steps with the error cancelled
  Options lcqp = Settings::subproblem_options();  ///< of each LCQP
};

/// The plan after one control step, and its origin.
struct RealTimeTick {
  Outcome outcome = Outcome::answered;  ///< the origin of x
  std::vector<double> x;                ///< n, the plan
  Multipliers multipliers;              ///< of the LCQP; of the last one if this one had no solution
  /// Of the LCQP; time_limit if its deadline has passed. Of the plain LCQP if the elastic one was used.
  Status status = Status::numerical_failure;
  bool deadline_met = true;  ///< false if the deadline had passed when the LCQP ended
  std::string why = {};      ///< the reason if there is no solution; else empty
  double step = 0.0;         ///< max |d_j| / scale_j: how far the plan was off
  /// Largest violation by the plan in the linearized rows, with the measurement; of the shifted plan if the
  /// shifted or the kept plan was returned.
  double violation = 0.0;
  std::optional<bool> b_stationary;  ///< of the LCQP
  std::int32_t ticks = 0;            ///< LCQPs of this control step: 1, or 2 with the elastic one
  std::int64_t factorizations = 0;   ///< of these LCQPs
  std::int32_t reopened = 0;         ///< how often a session was opened again elsewhere, in this control step
};

/// The closed loop. Use one thread at a time.
class RealTime {
 public:
  /// Opens the session. Its patterns are those at problem.start, which is also the first plan. Errors: as
  /// solve(); invalid_argument for "measured.variables[2]" and such, "settings.curvature",
  /// "settings.shift.variables[0].count" and such.
  [[nodiscard]] static Expected<RealTime> create(const Problem& problem, const Measured& measured,
                                                 const OpenTicks& open,
                                                 const RealTimeSettings& settings = {});
  /// The same with a session of the client, in process or on its server: the same bits. Part of
  /// marble::client.
  [[nodiscard]] static Expected<RealTime> create(const Problem& problem, const Measured& measured,
                                                 const Client& client, const RealTimeSettings& settings = {});

  /// A moved-from object may only be assigned to or destroyed.
  RealTime(RealTime&&) noexcept;
  /// As the constructor.
  RealTime& operator=(RealTime&&) noexcept;
  ~RealTime();

  /// Shifts the plan, unless there was no control step since the last call; evaluates the functions there and
  /// sends everything that does not depend on the measurement. Errors: those of the functions, as in solve();
  /// unavailable and any other error that ends the session.
  [[nodiscard]] Expected<void> prepare();

  /// Solves one LCQP with the measurement, which has as many entries as `Measured` names. Returns the new
  /// plan within `deadline_s` seconds from now, or the fallback. Calls prepare() first if needed. Errors:
  /// invalid_argument, field "measurement"; cancelled, unavailable and any other error that ends the session.
  [[nodiscard]] Expected<RealTimeTick> feedback(std::span<const double> measurement, double deadline_s = 1e9);

  /// Sets another plan to continue from, n entries; it is not shifted first.
  [[nodiscard]] Expected<void> restart(std::span<const double> x);

 private:
  struct State;
  explicit RealTime(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble::nonlinear
