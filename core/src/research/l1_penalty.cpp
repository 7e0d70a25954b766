#include "research/l1_penalty.h"

#include <cmath>

#include "research/tuning.h"

namespace marble {

L1Penalty::L1Penalty(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      qp_(problem, kkt),
      x_(problem),
      s_chosen_(static_cast<std::size_t>(problem.pairs())),
      rows_(problem.layout.size()),
      costs_(problem.layout.size()) {}

void L1Penalty::start(ConstVectorRef initial_z) {
  qp_.start(initial_z);
  x_.all.setZero();
  x_.z() = initial_z;
  penalty_ = 0.0;  // of the first QP, whose minimum selects the first sides
  costs_.setZero();
}

// Chooses the smaller sides; a tie changes nothing. Returns false if none has changed.
bool L1Penalty::choose_sides(bool first) {
  const RowLayout& layout = problem_.layout;
  bool changed = false;
  for (Index i = 0; i < layout.pairs; ++i) {
    const double s = rows_[layout.s(i)], t = rows_[layout.t(i)];
    const bool tie = !first && std::abs(s - t) <= tuning::exactness;
    const std::uint8_t chosen = tie ? s_chosen_[i] : s < t;
    changed = changed || chosen != s_chosen_[i];
    s_chosen_[i] = chosen;
  }
  return changed;
}

ReferenceMethod::State L1Penalty::step(Run& run) {
  if (!qp_.solve(run, costs_)) return State::failed;
  ++run.iterations;
  x_.z() = qp_.solution().z();
  x_.y() = qp_.solution().y();
  x_.lambda() = qp_.solution().lambda() + costs_;
  multiply(problem_.rows, x_.z(), rows_);
  rows_ += problem_.offset;
  const bool first = penalty_ == 0.0;
  const bool changed = choose_sides(first);
  if (first || !changed) {
    if (is_complementary(problem_.layout, rows_)) return State::ended;
    if (penalty_ >= tuning::l1_most) return State::given_up;
    penalty_ = first ? tuning::reference_first : tuning::reference_factor * penalty_;
  }
  const RowLayout& layout = problem_.layout;
  costs_.setZero();
  for (Index i = 0; i < layout.pairs; ++i) costs_[s_chosen_[i] ? layout.s(i) : layout.t(i)] = penalty_;
  return State::going_on;
}

}  // namespace marble
