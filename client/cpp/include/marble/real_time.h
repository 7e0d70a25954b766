// Real-time iteration: a nonlinear plan in closed loop, by one LCQP a tick. What does not need the
// measurement is done before it comes.
//
//   auto loop = marble::nonlinear::RealTime::create(problem, {.variables = {0, 1}}, client, {.shift =
//   one_stage}); for (;;) {
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

/// Where the measurement enters (initial-value embedding): linearly, so that all else can be made ready
/// before.
struct Measured {
  /// Each is fixed at its entry of the measurement, whatever its bounds are.
  std::vector<Index> variables = {};
  /// Rows of c_E, each of which must be its entry of the measurement, after those of the variables, in place
  /// of 0.
  std::vector<Index> equalities = {};
};

/// What a tick returns whose LCQP has no answer: because its deadline has passed, or because it has none.
enum class Fallback {
  keep,     ///< the plan that the last tick returned, where it is
  shifted,  ///< the last plan, moved on
  /// The answer of the elastic LCQP, whose rows may each lack something, at a price, with what is left of the
  /// deadline; where that has no answer either, and where the deadline has passed, the last plan, moved on.
  elastic,
};

/// What a tick returned.
enum class Outcome { answered, kept, shifted, elastic };

/// "answered", "kept", "shifted" or "elastic".
[[nodiscard]] const char* to_string(Outcome outcome);

/// All of it optional.
struct RealTimeSettings {
  Curvature curvature = Curvature::automatic;  ///< not bfgs, which would need more than a step a tick
  double diagonal = 0.0;                  ///< over scale², added to B's diagonal, ≥ 0: keeps steps short
  double radius = 1e6;                    ///< of steps, in units of scale, > 0
  Fallback fallback = Fallback::shifted;  ///< what a tick without an answer returns
  /// How the plan moves on from tick to tick: stretches of x, of c_E, of c_I and of the pairs. None: it
  /// stays.
  Shift shift = {};
  /// What the shift leaves to do, such as a better last stage; after it.
  std::function<void(std::span<double> x)> moved = {};
  bool reopen = false;                            ///< as Settings has it
  ProgressSink* progress = nullptr;               ///< told of what each tick does
  std::stop_token stop = {};                      ///< ends the ticks with the error cancelled
  Options lcqp = Settings::subproblem_options();  ///< of each LCQP
};

/// The plan after one tick, and where it is from.
struct RealTimeTick {
  Outcome outcome = Outcome::answered;  ///< where x is from
  std::vector<double> x;                ///< n, the plan
  Multipliers multipliers;              ///< of the LCQP; of the last one where this had no answer
  /// Of the LCQP; time_limit if its deadline has passed. Of the plain one, if the elastic one answered.
  Status status = Status::numerical_failure;
  bool deadline_met = true;  ///< whether it had not passed when the LCQP ended
  std::string why = {};      ///< there is no answer; else empty
  double step = 0.0;         ///< max |d_j| / scale_j: how far the plan was off
  /// Largest violation that the plan leaves in the linearised rows, with the measurement; of the moved plan
  /// where that, or the kept one, was returned.
  double violation = 0.0;
  std::optional<bool> b_stationary;  ///< of the LCQP
  std::int32_t ticks = 0;            ///< LCQPs of this tick: 1, or 2 with the elastic one
  std::int64_t factorizations = 0;   ///< of these
  std::int32_t reopened = 0;         ///< how often a session was set up again elsewhere, in this tick
};

/// One thread at a time.
class RealTime {
 public:
  /// Opens the session. Its patterns are those at problem.start, which is also the first plan. Errors: as
  /// solve() has them; invalid_argument of "measured.variables[2]" and such, "settings.curvature",
  /// "settings.shift.variables[0].count" and such.
  [[nodiscard]] static Expected<RealTime> create(const Problem& problem, const Measured& measured,
                                                 const OpenTicks& open,
                                                 const RealTimeSettings& settings = {});
  /// The same with a session of the client's, in process or on its server: the same bits. Of marble::client.
  [[nodiscard]] static Expected<RealTime> create(const Problem& problem, const Measured& measured,
                                                 const Client& client, const RealTimeSettings& settings = {});

  /// What was moved from may only be assigned to or destroyed.
  RealTime(RealTime&&) noexcept;
  /// As the constructor.
  RealTime& operator=(RealTime&&) noexcept;
  ~RealTime();

  /// Moves the plan on, unless there was no tick since the last time, calls the functions there and sends all
  /// that does not depend on the measurement. Errors: a function's, as solve() has them; unavailable and
  /// whatever else ends the session.
  [[nodiscard]] Expected<void> prepare();

  /// One LCQP: the plan's answer to a measurement, of as many entries as `Measured` names. Within
  /// `deadline_s` seconds from now, or what the fallback says. Prepares first if that was not done. Errors:
  /// invalid_argument, field "measurement"; cancelled, unavailable and whatever else ends the session.
  [[nodiscard]] Expected<RealTimeTick> feedback(std::span<const double> measurement, double deadline_s = 1e9);

  /// Another plan to go on from, n entries; it is not moved on first.
  [[nodiscard]] Expected<void> restart(std::span<const double> x);

 private:
  struct State;
  explicit RealTime(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble::nonlinear
