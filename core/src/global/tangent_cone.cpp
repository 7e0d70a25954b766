#include "global/tangent_cone.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "model/tuning.h"
#include "proof/row_problem.h"

namespace marble {

bool TangentCone::applies(const Images& images, std::span<const Index> biactive) {
  const auto active = (images.rows.inequality().array() <= tuning::zero).count();
  return active + 2 * static_cast<std::ptrdiff_t>(biactive.size()) <= tuning::dense_rows;
}

TangentCone::TangentCone(const ScaledProblem& problem, const Images& images, std::span<const Index> biactive)
    : biactive_(biactive.begin(), biactive.end()), cone_(empty_problem(problem.variables())) {
  const RowLayout& layout = problem.layout;
  const Vector& slacks = images.rows.all;
  cone_.Q = identity(problem.variables());
  cone_.A = problem.A;
  for (Index pair = 0; pair < layout.pairs; ++pair) {
    if (std::ranges::binary_search(biactive_, pair)) continue;
    const bool s = slacks[layout.s(pair)] <= slacks[layout.t(pair)];
    append_row(problem.rows, s ? layout.s(pair) : layout.t(pair), cone_.A);
  }
  for (Index row = 0; row < layout.inequalities; ++row) {
    if (slacks[row] <= tuning::zero) append_row(problem.rows, row, cone_.rows);
  }
  for (const Index pair : biactive_) {
    append_row(problem.rows, layout.s(pair), cone_.rows);
    append_row(problem.rows, layout.t(pair), cone_.rows);
  }
  cone_.layout.inequalities = cone_.rows.rows;
  cone_.b.setZero(cone_.A.rows);
  cone_.offset.setZero(cone_.rows.rows);
  cone_.variable_scale = problem.variable_scale;
  cone_.equality_scale.setOnes(cone_.A.rows);
  cone_.row_scale.setOnes(cone_.rows.rows);
  cone_.g = images.gradient;
  if (const double size = max_abs(cone_.g); size > 0.0) cone_.g /= size;
}

Index TangentCone::row(std::size_t pair, bool s) const {
  return cone_.rows.rows - 2 * static_cast<Index>(biactive_.size() - pair) + (s ? 0 : 1);
}

bool TangentCone::start(Run& run) {
  kkt_ = make_system(cone_, run);
  if (kkt_ == nullptr) return false;
  kkt_->attend(run.interrupt());
  kkt_->load(cone_);
  system_.emplace(cone_, *kkt_);
  ++run.factorizations;
  if (!system_->factor(tuning::exact_rho, 0.0)) return false;
  gram_.emplace(cone_);
  columns_.emplace(cone_, *gram_, *system_);
  set_.emplace(*columns_);
  const Vector none = Vector::Zero(cone_.layout.size());
  Vector d = Vector::Zero(cone_.variables()), y = Vector::Zero(cone_.equalities());
  Vector slacks(cone_.layout.size());
  if (!system_->minimize(none, d, y)) return false;
  multiply(cone_.rows, d, slacks);
  set_->start(none, slacks);
  return true;
}

// A direction or a slack this small is zero, as are wrong signs of multipliers that classify() accepts.
double TangentCone::zero() const { return tuning::zero * (1.0 + max_abs(set_->multipliers())); }

// The projection of −g onto the relaxation.
TangentCone::Node TangentCone::solve(const Interrupt& interrupt) {
  if (set_->run(std::numeric_limits<double>::infinity(), tuning::tree_steps, interrupt) !=
      DualActiveSet::End::optimal)
    return Node::undecided;
  Vector d = Vector::Zero(cone_.variables()), y = Vector::Zero(cone_.equalities());
  if (!system_->minimize(set_->multipliers(), d, y)) return Node::undecided;
  if (max_abs(d) <= zero()) return Node::closed;
  double widest = zero();
  widest_ = biactive_.size();
  for (std::size_t pair = 0; pair < biactive_.size(); ++pair) {
    const double width = std::min(set_->slacks()[row(pair, true)], set_->slacks()[row(pair, false)]);
    if (width <= widest) continue;
    widest = width;
    widest_ = pair;
  }
  return widest_ < biactive_.size() ? Node::open : Node::descends;
}

TangentCone::End TangentCone::search(Run& run, int most_nodes) {
  if (!start(run)) return End::undecided;
  struct Child {
    std::shared_ptr<const State> parent;
    Index fixed;
  };
  std::vector<Child> children;
  for (int nodes = 0; nodes < most_nodes && !run.interrupted(); ++nodes) {
    switch (solve(run.interrupt())) {
      case Node::undecided:
        return End::undecided;
      case Node::descends:
        return End::descent;
      case Node::closed:
        break;
      case Node::open: {
        auto state = std::make_shared<State>();
        set_->save(*state);
        const bool s_first = set_->slacks()[row(widest_, true)] <= set_->slacks()[row(widest_, false)];
        children.push_back({state, row(widest_, !s_first)});
        children.push_back({state, row(widest_, s_first)});
        break;
      }
    }
    if (children.empty()) return End::no_descent;
    const Child child = std::move(children.back());
    children.pop_back();
    set_->restore(*child.parent);
    set_->set_kind(child.fixed, DualActiveSet::RowKind::fixed);
  }
  return End::undecided;
}

WorkingSet TangentCone::branch(WorkingSet set) const {
  for (std::size_t pair = 0; pair < biactive_.size(); ++pair) {
    const double s = set_->slacks()[row(pair, true)], t = set_->slacks()[row(pair, false)];
    const bool fixed_s = set.s_fixed[biactive_[pair]] != 0;
    if ((fixed_s ? s : t) > zero()) set.fix(biactive_[pair], !fixed_s, false);
  }
  return set;
}

}  // namespace marble
