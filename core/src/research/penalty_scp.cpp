#include "research/penalty_scp.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "path/noise.h"
#include "research/tuning.h"

namespace marble {

PenaltyScp::PenaltyScp(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      qp_(problem, kkt),
      x_(problem),
      step_(problem.variables()),
      product_(problem.variables()),
      rows_(problem.layout.size()),
      rates_(problem.layout.size()),
      costs_(problem.layout.size()) {}

void PenaltyScp::start(ConstVectorRef initial_z) {
  qp_.start(initial_z);
  x_.all.setZero();
  x_.z() = initial_z;
  penalty_ = 0.0;  // of the first QP, whose minimum is the start
  evaluate_rows();
}

// Computes s, t and the cost of πφ by row, π(t, s).
void PenaltyScp::evaluate_rows() {
  const RowLayout& layout = problem_.layout;
  multiply(problem_.rows, x_.z(), rows_);
  rows_ += problem_.offset;
  costs_.setZero();
  layout.s_part(costs_) = penalty_ * layout.t_part(rows_);
  layout.t_part(costs_) = penalty_ * layout.s_part(rows_);
}

double PenaltyScp::length(double slope) {
  const RowLayout& layout = problem_.layout;
  multiply(problem_.Q, step_, product_);
  multiply(problem_.rows, step_, rates_);
  const double curvature =
      step_.dot(product_) + 2.0 * penalty_ * layout.s_part(rates_).dot(layout.t_part(rates_));
  return curvature <= 0.0 ? 1.0 : std::clamp(-slope / curvature, 0.0, 1.0);
}

// The multipliers of the pairs' sides are those of the QP plus the penalty's part, π(t, s).
ReferenceMethod::State PenaltyScp::step(Run& run) {
  if (!qp_.solve(run, costs_)) return State::failed;
  ++run.iterations;
  const Iterate& minimum = qp_.solution();
  step_ = minimum.z() - x_.z();
  multiply(problem_.Q, x_.z(), product_);
  const double size = 1.0 + std::abs(problem_.g.dot(x_.z()) + 0.5 * product_.dot(x_.z()));
  product_ += problem_.g;
  add_transposed(problem_.rows, costs_, product_);
  const double slope = step_.dot(product_);
  const bool first = penalty_ == 0.0;
  step_length_ = first ? 1.0 : length(slope);
  const bool stationary = first || -slope <= tuning::rounding * size;
  x_.z() += step_length_ * step_;
  // A point between the sides of a pair may be stationary for every π. LCQPow also perturbs its steps.
  for (Index i = 0; i < problem_.variables(); ++i)
    x_.z()[i] += tuning::roundoff * (noise(static_cast<std::uint64_t>(run.iterations), i) - 0.5);
  x_.y() = minimum.y();
  x_.lambda() = minimum.lambda() + costs_;
  evaluate_rows();
  if (!stationary) return State::going_on;
  if (is_complementary(problem_.layout, rows_)) return State::ended;
  if (penalty_ >= tuning::scp_most) return State::given_up;
  penalty_ = first ? tuning::reference_first : tuning::scp_factor * penalty_;
  evaluate_rows();
  return State::going_on;
}

}  // namespace marble
