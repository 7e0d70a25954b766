#include "lcs/assembly.h"

#include <algorithm>

#include "lcs/dense.h"
#include "model/column_builder.h"

namespace marble {
namespace {

// Writes a matrix column by column, and returns the end.
double* put(double* to, const SmallLcp::ConstMap& matrix) {
  Eigen::Map<Eigen::MatrixXd>(to, matrix.rows(), matrix.cols()) = matrix;
  return to + matrix.size();
}

}  // namespace

LcsAssembly::LcsAssembly(const CheckedTask& task)
    : states_(task.states),
      inputs_(task.inputs),
      pairs_(task.pairs),
      stages_(task.stages),
      width_(task.inputs + task.pairs + task.states) {
  problem_.name = "lcs";
  problem_.hessian_form = HessianForm::upper_triangle;
  problem_.g.assign(product(stages_, width_), 0.0);
  problem_.b.assign(product(stages_, states_), 0.0);
  problem_.d.clear();
  problem_.l.assign(product(stages_, pairs_), 0.0);
  problem_.r.assign(product(stages_, pairs_), 0.0);
  make_hessian(task);
  make_dynamics();
  make_bounds(task);
  make_pairs();
}

void LcsAssembly::make_hessian(const CheckedTask& task) {
  ColumnBuilder columns(stages_ * width_);
  const bool changes = !task.R_change.empty();
  for (Index k = 0; k < stages_; ++k) {
    const Index u = k * width_, lam = u + inputs_, x = lam + pairs_;
    const auto R = matrix_of(part_of(task.R, product(inputs_, inputs_), k), inputs_, inputs_);
    for (Index j = 0; j < inputs_; ++j) {
      const auto change = [&](Index i) {
        return changes ? task.R_change[static_cast<std::size_t>(i * inputs_ + j)] : 0.0;
      };
      for (Index i = 0; i < inputs_ && changes && k > 0; ++i) columns.add(u - width_ + i, -2.0 * change(i));
      for (Index i = 0; i <= j; ++i)
        columns.add(u + i, 2.0 * R(i, j) + (k + 1 < stages_ ? 4.0 : 2.0) * change(i));
      columns.end_column();
    }
    for (Index j = 0; j < pairs_; ++j) {
      if (task.regularization > 0.0) columns.add(lam + j, 2.0 * task.regularization);
      columns.end_column();
    }
    const auto Q = k + 1 < stages_
                       ? matrix_of(part_of(task.Q, product(states_, states_), k + 1), states_, states_)
                       : matrix_of(task.P, states_, states_);
    for (Index j = 0; j < states_; ++j) {
      for (Index i = 0; i <= j; ++i) columns.add(x + i, 2.0 * Q(i, j));
      columns.end_column();
    }
  }
  problem_.Q = columns.take();
}

void LcsAssembly::make_dynamics() {
  ColumnBuilder columns(stages_ * states_);
  for (Index k = 0; k < stages_; ++k) {
    for (Index j = 0; j < inputs_ + pairs_; ++j) {
      columns.add_zeros(k * states_, states_);
      columns.end_column();
    }
    for (Index j = 0; j < states_; ++j) {
      columns.add(k * states_ + j, -1.0);
      if (k + 1 < stages_) columns.add_zeros((k + 1) * states_, states_);
      columns.end_column();
    }
  }
  problem_.A = columns.take();
}

void LcsAssembly::make_bounds(const CheckedTask& task) {
  const auto rows = static_cast<Index>(task.bounds.size());
  if (rows == 0) return;
  problem_.d.assign(product(stages_, rows), 0.0);
  ColumnBuilder columns(stages_ * rows);
  const auto add = [&](Index stage, LcsBound::Of of, Index entry, double factor) {
    for (Index i = 0; i < rows; ++i) {
      const LcsBound& bound = task.bounds[static_cast<std::size_t>(i)];
      const bool is_input = of == LcsBound::Of::input && bound.of == LcsBound::Of::input_change;
      if (bound.entry != entry || !(bound.of == of || is_input)) continue;
      columns.add(stage * rows + i, factor * bound.sign);
    }
  };
  for (Index k = 0; k < stages_; ++k) {
    for (Index j = 0; j < inputs_; ++j) {
      add(k, LcsBound::Of::input, j, 1.0);
      if (k + 1 < stages_) add(k + 1, LcsBound::Of::input_change, j, -1.0);
      columns.end_column();
    }
    for (Index j = 0; j < pairs_; ++j) columns.end_column();
    for (Index j = 0; j < states_; ++j) {
      add(k, LcsBound::Of::state, j, 1.0);
      columns.end_column();
    }
  }
  problem_.C = columns.take();
}

void LcsAssembly::make_pairs() {
  if (pairs_ == 0) return;
  ColumnBuilder left(stages_ * pairs_), right(stages_ * pairs_);
  for (Index k = 0; k < stages_; ++k) {
    for (Index j = 0; j < width_; ++j) {
      if (j >= inputs_ && j < inputs_ + pairs_) left.add(k * pairs_ + j - inputs_, 1.0);
      left.end_column();
      if (j < inputs_ + pairs_) {
        right.add_zeros(k * pairs_, pairs_);
      } else if (k + 1 < stages_) {
        right.add_zeros((k + 1) * pairs_, pairs_);
      }
      right.end_column();
    }
  }
  problem_.L = left.take(), problem_.R = right.take();
}

void LcsAssembly::set_matrices(const LCS& lcs) {
  double* a = problem_.A.values.data();
  double* r = problem_.R.values.data();
  for (Index k = 0; k < stages_; ++k) {
    const LcsStage stage(lcs, k);
    a = put(put(a, stage.B), stage.D);
    if (pairs_ > 0) r = put(put(r, stage.H), stage.F);
    if (k + 1 == stages_) break;
    const LcsStage next(lcs, k + 1);
    for (Index j = 0; j < states_; ++j) {  // after the −1 of x_{k+1}
      VectorMap(a + 1, states_) = next.A.col(j);
      a += 1 + states_;
    }
    if (pairs_ > 0) r = put(r, next.E);
  }
}

void LcsAssembly::set_state(const LCS& lcs, std::span<const double> x0) {
  for (Index k = 0; k < stages_; ++k) {
    const LcsStage stage(lcs, k);
    stage_of(std::span(problem_.b), k, states_) = stage.d;
    stage_of(std::span(problem_.r), k, pairs_) = stage.c;
    if (k > 0) continue;
    const auto x = stage_of(x0, 0, states_);
    stage_of(std::span(problem_.b), 0, states_).noalias() += stage.A * x;
    stage_of(std::span(problem_.r), 0, pairs_).noalias() += stage.E * x;
  }
}

void LcsAssembly::set_costs(const CheckedTask& task, std::span<const double> x0,
                            std::span<const double> last_u) {
  double constant = 0.0;
  const std::span<const double> x_refs = task.x_ref, u_refs = task.u_ref;
  for (Index k = 0; k <= stages_; ++k) {
    const auto Q = k < stages_ ? matrix_of(part_of(task.Q, product(states_, states_), k), states_, states_)
                               : matrix_of(task.P, states_, states_);
    const auto x_ref = stage_of(x_refs, k, states_);
    if (k > 0) {
      auto g = VectorMap(&problem_.g[product(k, width_) - static_cast<std::size_t>(states_)], states_);
      g.noalias() = -2.0 * (Q * x_ref);
      constant -= 0.5 * g.dot(x_ref);
    } else {
      const Vector error = stage_of(x0, 0, states_) - x_ref;
      constant += error.dot(Q * error);
    }
    if (k == stages_) break;
    const auto R = matrix_of(part_of(task.R, product(inputs_, inputs_), k), inputs_, inputs_);
    const auto u_ref = stage_of(u_refs, k, inputs_);
    auto g = VectorMap(&problem_.g[product(k, width_)], inputs_);
    g.noalias() = -2.0 * (R * u_ref);
    constant -= 0.5 * g.dot(u_ref);
    if (k > 0 || task.R_change.empty()) continue;
    const auto before = stage_of(last_u, 0, inputs_);
    const Vector weighted = matrix_of(task.R_change, inputs_, inputs_) * before;
    g -= 2.0 * weighted;
    constant += before.dot(weighted);
  }
  problem_.c0 = constant;
}

void LcsAssembly::set_limits(const CheckedTask& task, std::span<const double> last_u) {
  std::size_t row = 0;
  for (Index k = 0; k < stages_; ++k) {
    for (const LcsBound& bound : task.bounds) {
      double& d = problem_.d[row++] = task.offset(bound, k);
      if (k == 0 && bound.of == LcsBound::Of::input_change)
        d -= bound.sign * last_u[static_cast<std::size_t>(bound.entry)];
    }
  }
}

void LcsAssembly::split(std::span<const double> z, LcsTrajectory& trajectory) const {
  for (Index k = 0; k < stages_; ++k) {
    const double* from = z.data() + product(k, width_);
    std::copy_n(from, inputs_, trajectory.u.data() + product(k, inputs_));
    std::copy_n(from + inputs_, pairs_, trajectory.lam.data() + product(k, pairs_));
    std::copy_n(from + inputs_ + pairs_, states_, trajectory.x.data() + product(k + 1, states_));
  }
}

void LcsAssembly::join(const LcsTrajectory& trajectory, std::span<double> z) const {
  for (Index k = 0; k < stages_; ++k) {
    double* to = z.data() + product(k, width_);
    std::copy_n(trajectory.u.data() + product(k, inputs_), inputs_, to);
    std::copy_n(trajectory.lam.data() + product(k, pairs_), pairs_, to + inputs_);
    std::copy_n(trajectory.x.data() + product(k + 1, states_), states_, to + inputs_ + pairs_);
  }
}

}  // namespace marble
