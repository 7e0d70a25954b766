#include "lcs/task.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lcs/check.h"
#include "lcs/dense.h"
#include "lcs/riccati.h"
#include "marble/contract.h"
#include "model/text_of.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Checks numbers that are one vector or matrix for all stages, or one per stage.
Expected<void> check_part(std::span<const double> values, std::size_t entries, Index stages,
                          const char* field) {
  if (values.size() != entries && values.size() != entries * static_cast<std::size_t>(stages)) {
    return unexpected(invalid(field, std::to_string(values.size()),
                              "must have " + std::to_string(entries) + " entries, or " +
                                  std::to_string(stages) + " times as many"));
  }
  return check_stages(values, entries, field);
}

Expected<void> check_symmetric(std::span<const double> values, Index size, const char* field) {
  const std::size_t entries = product(size, size);
  for (std::size_t stage = 0; stage * entries < values.size(); ++stage) {
    const auto matrix = matrix_of(values.subspan(stage * entries, entries), size, size);
    const double noise = contract::symmetry * matrix.cwiseAbs().maxCoeff();
    for (Index i = 0; i < size; ++i) {
      for (Index j = 0; j < i; ++j) {
        if (std::abs(matrix(i, j) - matrix(j, i)) <= noise) continue;
        const bool per_stage = values.size() > entries;
        return unexpected(invalid(field + (per_stage ? "[" + std::to_string(stage) + "]" : std::string()),
                                  std::int64_t{i} * size + j, text_of(matrix(i, j)),
                                  "must be symmetric: entry (" + std::to_string(j) + ", " +
                                      std::to_string(i) + ") is " + text_of(matrix(j, i))));
      }
    }
  }
  return {};
}

// Limits of `size` entries; of an absent one, `none`.
Expected<std::vector<double>> limits_of(const std::vector<double>& given, Index size, double none,
                                        const char* field) {
  if (given.empty()) return std::vector<double>(static_cast<std::size_t>(size), none);
  if (given.size() != static_cast<std::size_t>(size)) {
    return unexpected(invalid(field, std::to_string(given.size()),
                              "must have " + std::to_string(size) + " entries, or none"));
  }
  std::vector<double> limits = given;
  for (std::size_t i = 0; i < limits.size(); ++i) {
    if (std::isnan(limits[i]) || limits[i] == -none) {
      return unexpected(
          invalid(field, static_cast<std::int64_t>(i), text_of(limits[i]),
                  none > 0.0 ? "must be a number or infinity" : "must be a number or -infinity"));
    }
    if (std::abs(limits[i]) >= infinite_limit && std::signbit(limits[i]) == std::signbit(none))
      limits[i] = none;
  }
  return limits;
}

Expected<void> check_order(const std::vector<double>& lower, const std::vector<double>& upper,
                           const char* lower_field, const char* upper_field) {
  for (std::size_t i = 0; i < lower.size(); ++i) {
    if (lower[i] <= upper[i]) continue;
    return unexpected(invalid(upper_field, static_cast<std::int64_t>(i), text_of(upper[i]),
                              std::string("must be >= ") + lower_field + ", " + text_of(lower[i])));
  }
  return {};
}

void add_bounds(std::vector<LcsBound>& bounds, LcsBound::Of of, const std::vector<double>& lower,
                const std::vector<double>& upper, const char* lower_field, const char* upper_field) {
  for (std::size_t i = 0; i < lower.size(); ++i) {
    const auto entry = static_cast<Index>(i);
    if (std::isfinite(lower[i])) bounds.push_back({of, entry, 1.0, -lower[i], lower_field});
    if (std::isfinite(upper[i])) bounds.push_back({of, entry, -1.0, upper[i], upper_field});
  }
}

double weighted(const SmallLcp::ConstMap& W, const ConstVectorMap& v, const ConstVectorMap& at) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < v.size(); ++i) sum += (v[i] - at[i]) * W.row(i).dot(v - at);
  return sum;
}

void expand(std::vector<double>& all, std::span<const double> given) {
  for (std::size_t i = 0; i < all.size() && !given.empty(); ++i) all[i] = given[i % given.size()];
}

}  // namespace

Expected<CheckedTask> CheckedTask::create(const LCS& lcs, const LcsTask& task) {
  CheckedTask made;
  made.states = lcs.states(), made.inputs = lcs.inputs(), made.pairs = lcs.pairs();
  if (task.stages < 1) return unexpected(invalid("stages", std::to_string(task.stages), "must be >= 1"));
  if (lcs.stages() > 0 && lcs.stages() != task.stages) {
    return unexpected(invalid("stages", std::to_string(task.stages),
                              "must be " + std::to_string(lcs.stages()) + ", as many as the system has"));
  }
  made.stages = task.stages;
  const double entries = 1.0 * made.stages * (made.states + made.inputs + made.pairs) *
                         (2.0 * made.states + made.pairs + made.inputs);
  if (entries > std::numeric_limits<Index>::max()) {
    return unexpected(invalid("stages", std::to_string(task.stages),
                              "the matrices of all stages must have fewer than 2^31 entries"));
  }
  if (auto valid = made.take_weights(lcs, task); !valid) return unexpected(valid.error());
  if (auto valid = made.take_bounds(task); !valid) return unexpected(valid.error());
  if (auto valid = made.check_targets(task.x_ref, task.u_ref); !valid) return unexpected(valid.error());
  made.x_ref.assign(product(made.stages + 1, made.states), 0.0);
  made.u_ref.assign(product(made.stages, made.inputs), 0.0);
  made.set_targets(task.x_ref, task.u_ref);
  return made;
}

Expected<void> CheckedTask::take_weights(const LCS& lcs, const LcsTask& task) {
  const auto check = [&](const std::vector<double>& values, Index size, Index count,
                         const char* field) -> Expected<void> {
    auto valid = check_part(values, product(size, size), count, field);
    return valid ? check_symmetric(values, size, field) : valid;
  };
  auto valid = check(task.Q, states, stages, "Q");
  if (valid) valid = check(task.R, inputs, stages, "R");
  if (valid && !task.P.empty()) valid = check(task.P, states, 1, "P");
  if (valid && !task.R_change.empty()) valid = check(task.R_change, inputs, 1, "R_change");
  if (!valid) return valid;
  if (!(task.regularization >= 0.0) || !std::isfinite(task.regularization))
    return unexpected(invalid("regularization", text_of(task.regularization), "must be finite and >= 0"));
  Q = task.Q, R = task.R, P = task.P, R_change = task.R_change, regularization = task.regularization;
  if (!P.empty()) return {};
  const LcsStage last(lcs, stages - 1);
  auto computed =
      riccati(last.A, last.B, matrix_of(part_of(Q, product(states, states), stages - 1), states, states),
              matrix_of(part_of(R, product(inputs, inputs), stages - 1), inputs, inputs));
  if (!computed) return unexpected(computed.error());
  P = *std::move(computed);
  return {};
}

Expected<void> CheckedTask::take_bounds(const LcsTask& task) {
  auto x_lb = limits_of(task.x_lb, states, -kInfinity, "x_lb");
  if (!x_lb) return unexpected(x_lb.error());
  auto x_ub = limits_of(task.x_ub, states, kInfinity, "x_ub");
  if (!x_ub) return unexpected(x_ub.error());
  auto u_lb = limits_of(task.u_lb, inputs, -kInfinity, "u_lb");
  if (!u_lb) return unexpected(u_lb.error());
  auto u_ub = limits_of(task.u_ub, inputs, kInfinity, "u_ub");
  if (!u_ub) return unexpected(u_ub.error());
  auto change = limits_of(task.max_u_change, inputs, kInfinity, "max_u_change");
  if (!change) return unexpected(change.error());
  auto valid = check_order(*x_lb, *x_ub, "x_lb", "x_ub");
  if (valid) valid = check_order(*u_lb, *u_ub, "u_lb", "u_ub");
  if (!valid) return valid;
  std::vector<double> least_change;
  for (std::size_t i = 0; i < change->size(); ++i) {
    if (!((*change)[i] >= 0.0)) {
      return unexpected(
          invalid("max_u_change", static_cast<std::int64_t>(i), text_of((*change)[i]), "must be >= 0"));
    }
    least_change.push_back(-(*change)[i]);
  }
  add_bounds(bounds, LcsBound::Of::input, *u_lb, *u_ub, "u_lb", "u_ub");
  add_bounds(bounds, LcsBound::Of::input_change, least_change, *change, "max_u_change", "max_u_change");
  add_bounds(bounds, LcsBound::Of::state, *x_lb, *x_ub, "x_lb", "x_ub");
  u_lb_ = *std::move(u_lb), u_ub_ = *std::move(u_ub), max_u_change_ = *std::move(change);
  return {};
}

Expected<void> CheckedTask::check_targets(std::span<const double> x_targets,
                                          std::span<const double> u_targets) const {
  if (!x_targets.empty()) {
    if (auto valid = check_part(x_targets, static_cast<std::size_t>(states), stages + 1, "x_ref"); !valid)
      return valid;
  }
  if (u_targets.empty()) return {};
  return check_part(u_targets, static_cast<std::size_t>(inputs), stages, "u_ref");
}

void CheckedTask::set_targets(std::span<const double> x_targets, std::span<const double> u_targets) {
  expand(x_ref, x_targets);
  expand(u_ref, u_targets);
}

double CheckedTask::objective(const LcsTrajectory& trajectory, std::span<const double> last_u) const {
  const std::span<const double> x = trajectory.x, u = trajectory.u;
  double sum = 0.0;
  for (Index k = 0; k < stages; ++k) {
    sum += weighted(matrix_of(part_of(Q, product(states, states), k), states, states), stage_of(x, k, states),
                    stage_of(std::span(x_ref), k, states));
    sum += weighted(matrix_of(part_of(R, product(inputs, inputs), k), inputs, inputs), stage_of(u, k, inputs),
                    stage_of(std::span(u_ref), k, inputs));
    if (!R_change.empty()) {
      sum += weighted(matrix_of(R_change, inputs, inputs), stage_of(u, k, inputs),
                      k == 0 ? stage_of(last_u, 0, inputs) : stage_of(u, k - 1, inputs));
    }
  }
  sum += weighted(matrix_of(P, states, states), stage_of(x, stages, states),
                  stage_of(std::span(x_ref), stages, states));
  for (const double lam : trajectory.lam) sum += regularization * lam * lam;
  return sum;
}

Violations CheckedTask::violations(const LCS& lcs, const LcsTrajectory& trajectory,
                                   std::span<const double> last_u, std::string* where) const {
  const std::span<const double> xs = trajectory.x, us = trajectory.u, lams = trajectory.lam;
  Violations worst;
  Vector error(states), gap(pairs);
  for (Index k = 0; k < stages; ++k) {
    const LcsStage stage(lcs, k);
    const auto x = stage_of(xs, k, states), next = stage_of(xs, k + 1, states);
    const auto u = stage_of(us, k, inputs), lam = stage_of(lams, k, pairs);
    const auto before = k == 0 ? stage_of(last_u, 0, inputs) : stage_of(us, k - 1, inputs);
    error = stage.d - next;
    error.noalias() += stage.A * x;
    error.noalias() += stage.B * u;
    error.noalias() += stage.D * lam;
    worst.equality = std::max(worst.equality, error.cwiseAbs().maxCoeff());
    if (pairs > 0) {
      gap = stage.c;
      gap.noalias() += stage.E * x;
      gap.noalias() += stage.F * lam;
      gap.noalias() += stage.H * u;
      worst.complementarity = std::max(worst.complementarity, gap.cwiseMin(lam).cwiseAbs().maxCoeff());
    }
    for (const LcsBound& bound : bounds) {
      double value = bound.of == LcsBound::Of::state ? next[bound.entry] : u[bound.entry];
      if (bound.of == LcsBound::Of::input_change) value -= before[bound.entry];
      const double violation = -(bound.sign * value + bound.offset);
      if (!(violation > worst.inequality)) continue;
      worst.inequality = violation;
      if (where != nullptr) {
        *where = std::string(bound.field) + "[" + std::to_string(bound.entry) + "] is violated by " +
                 general(violation, 3) + " in stage " +
                 std::to_string(bound.of == LcsBound::Of::state ? k + 1 : k);
      }
    }
  }
  return worst;
}

void CheckedTask::clip(std::span<double> u, std::span<const double> last_u) const {
  const double* before = last_u.data();
  for (std::size_t k = 0; k < u.size(); ++k) {
    const std::size_t i = k % static_cast<std::size_t>(inputs);
    u[k] = std::clamp(u[k], before[i] - max_u_change_[i], before[i] + max_u_change_[i]);
    u[k] = std::clamp(u[k], u_lb_[i], u_ub_[i]);
    if (i + 1 == static_cast<std::size_t>(inputs)) before = &u[k] - i;
  }
}

}  // namespace marble
