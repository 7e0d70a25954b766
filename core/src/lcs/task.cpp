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

std::string field_of(const char* field, bool per_stage, std::size_t stage) {
  return per_stage ? std::string(field) + "[" + std::to_string(stage) + "]" : std::string(field);
}

// Takes limits of every stage, given for all or for each; absent ones keep their values. Those of a step have
// the rows of the limits that they replace.
Expected<void> take(std::vector<double>& to, std::span<const double> given, Index size, Index stages,
                    double none, const char* field, bool of_step) {
  const std::size_t width = static_cast<std::size_t>(size), all = product(stages, size);
  if (given.empty()) return {};
  if (given.size() != width && given.size() != all) {
    return unexpected(invalid(field, std::to_string(given.size()),
                              "must have " + std::to_string(width) + " entries, or " +
                                  std::to_string(stages) + " times as many" + (of_step ? "" : ", or none")));
  }
  std::vector<double> limits(all);
  const bool per_stage = given.size() > width;
  for (std::size_t i = 0; i < all; ++i) {
    double& limit = limits[i] = given[i % given.size()];
    const auto wrong = [&](const std::string& bound) {
      return unexpected(invalid(field_of(field, per_stage, i / width), static_cast<std::int64_t>(i % width),
                                text_of(given[i % given.size()]), bound));
    };
    if (std::isnan(limit) || limit == -none)
      return wrong(none > 0.0 ? "must be a number or infinity" : "must be a number or -infinity");
    if (std::abs(limit) >= infinite_limit && std::signbit(limit) == std::signbit(none)) limit = none;
    const bool has_row = std::isfinite(of_step ? to[i % width] : limits[i % width]);
    if (std::isfinite(limit) == has_row) continue;
    if (!of_step) return wrong("must be finite in all stages or in none");
    return wrong(has_row ? "must be finite, as at the beginning: the rows of the LCQP are fixed"
                         : "must be infinite, as at the beginning: the LCQP has no row for it");
  }
  to = std::move(limits);
  return {};
}

// `given`: a task or a step.
template <class Given>
Expected<void> take_limits(const CheckedTask& task, const Given& given, bool of_step, LcsLimits& to) {
  const auto take_one = [&](std::vector<double>& limits, std::span<const double> values, Index size,
                            double none, const char* field) {
    return take(limits, values, size, task.stages, none, field, of_step);
  };
  auto valid = take_one(to.x_lb, given.x_lb, task.states, -kInfinity, "x_lb");
  if (valid) valid = take_one(to.x_ub, given.x_ub, task.states, kInfinity, "x_ub");
  if (valid) valid = take_one(to.u_lb, given.u_lb, task.inputs, -kInfinity, "u_lb");
  if (valid) valid = take_one(to.u_ub, given.u_ub, task.inputs, kInfinity, "u_ub");
  return valid;
}

// Limits of all stages, and what was given of them.
struct Side {
  const std::vector<double>& limits;
  std::span<const double> given;
  const char* field;
};

// The error names limits that were given: the upper ones if both were.
Expected<void> check_order(const Side& lower, const Side& upper, Index size) {
  const auto width = static_cast<std::size_t>(size);
  const auto differs = [&](const Side& side) {  // by stage
    const std::vector<double>& all = side.limits;
    return side.given.size() > width || !std::equal(all.begin() + size, all.end(), all.begin());
  };
  const bool per_stage = differs(lower) || differs(upper), names_upper = !upper.given.empty();
  const Side &named = names_upper ? upper : lower, &other = names_upper ? lower : upper;
  for (std::size_t i = 0; i < lower.limits.size(); ++i) {
    if (lower.limits[i] <= upper.limits[i]) continue;
    return unexpected(invalid(field_of(named.field, per_stage, i / width),
                              static_cast<std::int64_t>(i % width), text_of(named.limits[i]),
                              std::string(names_upper ? "must be >= " : "must be <= ") + other.field + ", " +
                                  text_of(other.limits[i])));
  }
  return {};
}

template <class Given>
Expected<void> check_orders(const CheckedTask& task, const Given& given, const LcsLimits& limits) {
  MARBLE_RETURN_IF_ERROR(
      check_order({limits.x_lb, given.x_lb, "x_lb"}, {limits.x_ub, given.x_ub, "x_ub"}, task.states));
  return check_order({limits.u_lb, given.u_lb, "u_lb"}, {limits.u_ub, given.u_ub, "u_ub"}, task.inputs);
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
  MARBLE_RETURN_IF_ERROR(made.take_weights(lcs, task));
  MARBLE_RETURN_IF_ERROR(made.take_bounds(task));
  MARBLE_RETURN_IF_ERROR(made.check_targets(task.x_ref, task.u_ref));
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
  MARBLE_ASSIGN_OR_RETURN(
      P, riccati(last.A, last.B, matrix_of(part_of(Q, product(states, states), stages - 1), states, states),
                 matrix_of(part_of(R, product(inputs, inputs), stages - 1), inputs, inputs)));
  return {};
}

Expected<void> CheckedTask::take_bounds(const LcsTask& task) {
  const auto none = [&](Index size, double limit) {
    return std::vector<double>(product(stages, size), limit);
  };
  limits = {none(states, -kInfinity), none(states, kInfinity), none(inputs, -kInfinity),
            none(inputs, kInfinity), none(inputs, kInfinity)};
  Expected<void> valid = take_limits(*this, task, false, limits);
  if (valid && !task.max_u_change.empty() && task.max_u_change.size() != static_cast<std::size_t>(inputs)) {
    valid = unexpected(invalid("max_u_change", std::to_string(task.max_u_change.size()),
                               "must have " + std::to_string(inputs) + " entries, or none"));
  }
  if (valid)
    valid = take(limits.max_u_change, task.max_u_change, inputs, stages, kInfinity, "max_u_change", false);
  if (valid) valid = check_orders(*this, task, limits);
  if (!valid) return valid;
  const auto negative = std::ranges::find_if(limits.max_u_change, [](double change) { return change < 0.0; });
  if (negative != limits.max_u_change.end()) {
    return unexpected(
        invalid("max_u_change", negative - limits.max_u_change.begin(), text_of(*negative), "must be >= 0"));
  }
  const auto add = [&](LcsBound::Of of, Index size, std::vector<double> LcsLimits::*lower,
                       std::vector<double> LcsLimits::*upper, const char* lower_field,
                       const char* upper_field) {
    for (Index i = 0; i < size; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (std::isfinite((limits.*lower)[at])) bounds.push_back({of, i, 1.0, lower, lower_field});
      if (std::isfinite((limits.*upper)[at])) bounds.push_back({of, i, -1.0, upper, upper_field});
    }
  };
  add(LcsBound::Of::input, inputs, &LcsLimits::u_lb, &LcsLimits::u_ub, "u_lb", "u_ub");
  add(LcsBound::Of::input_change, inputs, &LcsLimits::max_u_change, &LcsLimits::max_u_change, "max_u_change",
      "max_u_change");
  add(LcsBound::Of::state, states, &LcsLimits::x_lb, &LcsLimits::x_ub, "x_lb", "x_ub");
  return {};
}

Expected<LcsLimits> CheckedTask::limits_after(const LcsStep& step) const {
  LcsLimits made = limits;
  auto valid = take_limits(*this, step, true, made);
  if (valid) valid = check_orders(*this, step, made);
  if (!valid) return unexpected(valid.error());
  return made;
}

double CheckedTask::offset(const LcsBound& bound, Index stage) const {
  const Index size = bound.of == LcsBound::Of::state ? states : inputs;
  const double limit = (limits.*bound.limits)[product(stage, size) + static_cast<std::size_t>(bound.entry)];
  return bound.of == LcsBound::Of::input_change ? limit : -bound.sign * limit;
}

Expected<void> CheckedTask::check_targets(std::span<const double> x_targets,
                                          std::span<const double> u_targets) const {
  if (!x_targets.empty()) {
    MARBLE_RETURN_IF_ERROR(check_part(x_targets, static_cast<std::size_t>(states), stages + 1, "x_ref"));
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
      const double violation = -(bound.sign * value + offset(bound, k));
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
    u[k] = std::clamp(u[k], before[i] - limits.max_u_change[i], before[i] + limits.max_u_change[i]);
    u[k] = std::clamp(u[k], limits.u_lb[k], limits.u_ub[k]);
    if (i + 1 == static_cast<std::size_t>(inputs)) before = &u[k] - i;
  }
}

}  // namespace marble
