#include "global/tangent_cone.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "kkt/kkt.h"
#include "model/tuning.h"
#include "search/distance.h"

namespace marble {
namespace {

void append_row(const RowMatrix& from, Index row, RowMatrix& to) {
  const Index begin = from.row_pointers[row], end = from.row_pointers[row + 1];
  to.column_indices.insert(to.column_indices.end(), from.column_indices.begin() + begin,
                           from.column_indices.begin() + end);
  to.values.insert(to.values.end(), from.values.begin() + begin, from.values.begin() + end);
  to.row_pointers.push_back(static_cast<Index>(to.column_indices.size()));
  ++to.rows;
}

}  // namespace

bool TangentCone::applies(const Images& images, std::span<const Index> biactive) {
  const auto active = (images.rows.inequality().array() <= tuning::zero).count();
  return active + 2 * static_cast<std::ptrdiff_t>(biactive.size()) <= tuning::tangent_rows;
}

TangentCone::TangentCone(const ScaledProblem& problem, const Images& images, std::span<const Index> biactive)
    : biactive_(biactive.begin(), biactive.end()), cone_(distance_problem(problem)) {
  const RowLayout& layout = problem.layout;
  const Vector& slacks = images.rows.all;
  RowMatrix active;
  active.columns = problem.variables();
  for (Index row = 0; row < layout.inequalities; ++row) {
    if (slacks[row] <= tuning::zero) append_row(problem.rows, row, active);
  }
  std::vector<std::uint8_t> both(static_cast<std::size_t>(layout.pairs), 0);
  for (const Index pair : biactive_) {
    both[static_cast<std::size_t>(pair)] = 1;
    append_row(problem.rows, layout.s(pair), active);
    append_row(problem.rows, layout.t(pair), active);
  }
  for (Index pair = 0; pair < layout.pairs; ++pair) {
    if (both[static_cast<std::size_t>(pair)] != 0) continue;
    const bool s = slacks[layout.s(pair)] <= slacks[layout.t(pair)];
    append_row(problem.rows, s ? layout.s(pair) : layout.t(pair), cone_.A);
  }
  cone_.b.setZero(cone_.A.rows);
  cone_.rows = std::move(active);
  cone_.layout = {.inequalities = cone_.rows.rows, .pairs = 0};
  cone_.offset.setZero(cone_.rows.rows);
  cone_.equality_scale.setOnes(cone_.A.rows);
  cone_.row_scale.setOnes(cone_.rows.rows);
  cone_.g = images.gradient;
  if (const double size = max_abs(cone_.g); size > 0.0) cone_.g /= size;
}

Index TangentCone::row(std::size_t pair, bool s) const {
  return cone_.rows.rows - 2 * static_cast<Index>(biactive_.size() - pair) + (s ? 0 : 1);
}

bool TangentCone::start(Run& run) {
  KktCost least;
  kkt_ = make_kkt(cone_, {run.bytes_left, std::numeric_limits<double>::infinity()}, run.interrupt(), least);
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

// The projection of −g onto the relaxation. The direction is as small as the wrong signs of multipliers that
// classify() accepts.
TangentCone::Node TangentCone::solve(const Interrupt& interrupt) {
  if (set_->run(std::numeric_limits<double>::infinity(), tuning::tree_steps, interrupt) !=
      DualActiveSet::End::optimal)
    return Node::undecided;
  Vector d = Vector::Zero(cone_.variables()), y = Vector::Zero(cone_.equalities());
  if (!system_->minimize(set_->multipliers(), d, y)) return Node::undecided;
  const double zero = tuning::zero * (1.0 + max_abs(set_->multipliers()));
  if (max_abs(d) <= zero) return Node::closed;
  double widest = zero;
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
  const double zero = tuning::zero * (1.0 + max_abs(set_->multipliers()));
  for (std::size_t pair = 0; pair < biactive_.size(); ++pair) {
    const double s = set_->slacks()[row(pair, true)], t = set_->slacks()[row(pair, false)];
    const bool fixed_s = set.s_fixed[biactive_[pair]] != 0;
    if ((fixed_s ? s : t) > zero) set.fix(biactive_[pair], !fixed_s, false);
  }
  return set;
}

}  // namespace marble
