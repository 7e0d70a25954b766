// A planning problem over a horizon, checked: its costs, targets and bounds, and how a trajectory meets them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "marble/lcs.h"

namespace marble {

/// Limits of every stage, stage after stage; ±∞ where there is none.
struct LcsLimits {
  std::vector<double> x_lb, x_ub, u_lb, u_ub, max_u_change;
};

/// A row sign · v[entry] + offset ≥ 0 of every stage, v being its input, its input's change or its next
/// state. The offset depends on the stage.
struct LcsBound {
  enum class Of { input, input_change, state } of;
  Index entry;
  double sign;  // 1: a lower limit, −1: an upper one
  std::vector<double> LcsLimits::*limits;
  const char* field;
};

class CheckedTask {
 public:
  /// Errors: those of LcsPlanner::create that concern the task.
  [[nodiscard]] static Expected<CheckedTask> create(const LCS& lcs, const LcsTask& task);

  /// Checks targets, which may be empty. Errors: "x_ref", "x_ref[3]", "u_ref".
  [[nodiscard]] Expected<void> check_targets(std::span<const double> x_ref,
                                             std::span<const double> u_ref) const;
  /// Takes targets that were checked; empty ones keep their values.
  void set_targets(std::span<const double> x_ref, std::span<const double> u_ref);

  /// Returns the limits after a step that may give some. Errors: "x_lb", "x_lb[3]" of row 3, "x_ub", "u_lb",
  /// "u_ub".
  [[nodiscard]] Expected<LcsLimits> limits_after(const LcsStep& step) const;
  /// Returns the offset of a bound in a stage.
  [[nodiscard]] double offset(const LcsBound& bound, Index stage) const;

  /// Returns the objective of a trajectory after the input `last_u`.
  [[nodiscard]] double objective(const LcsTrajectory& trajectory, std::span<const double> last_u) const;
  /// Returns the largest violations of a trajectory. `where`: if not null, receives the bound that is
  /// violated most, as text.
  [[nodiscard]] Violations violations(const LCS& lcs, const LcsTrajectory& trajectory,
                                      std::span<const double> last_u, std::string* where = nullptr) const;
  /// Moves inputs within their bounds, and within the bounds of their changes where these allow it.
  void clip(std::span<double> u, std::span<const double> last_u) const;

  Index states = 0, inputs = 0, pairs = 0, stages = 0;
  std::vector<double> Q, R, P, R_change;  // as in LcsTask; P is always there
  double regularization = 0.0;
  std::vector<double> x_ref, u_ref;  // of every stage
  std::vector<LcsBound> bounds;
  LcsLimits limits;

 private:
  [[nodiscard]] Expected<void> take_weights(const LCS& lcs, const LcsTask& task);
  [[nodiscard]] Expected<void> take_bounds(const LcsTask& task);
};

}  // namespace marble
