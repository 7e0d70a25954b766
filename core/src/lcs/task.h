// A planning problem over a horizon, checked: its costs, targets and bounds, and how a trajectory meets them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "marble/lcs.h"

namespace marble {

/// A row sign · v[entry] + offset ≥ 0 of every stage, v being its input, its input's change or its next
/// state.
struct LcsBound {
  enum class Of { input, input_change, state } of;
  Index entry;
  double sign;    // 1: a lower limit, −1: an upper one
  double offset;  // −limit or limit
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

 private:
  [[nodiscard]] Expected<void> take_weights(const LCS& lcs, const LcsTask& task);
  [[nodiscard]] Expected<void> take_bounds(const LcsTask& task);

  std::vector<double> u_lb_, u_ub_, max_u_change_;  // of every input; ±∞ where there is none
};

}  // namespace marble
