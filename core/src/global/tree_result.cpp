// The reports of a tree: its bound and gap, during the search and at its end.
#include <algorithm>
#include <cmath>
#include <limits>

#include "global/tree.h"
#include "model/text_of.h"
#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double relative_gap(double objective, double bound) {
  return std::max(0.0, objective - bound) / std::max(1.0, std::abs(objective));
}

double within(const Options& options) { return std::max(options.relative_gap_tolerance, tuning::exactness); }

}  // namespace

void TreeResult::report(Solution& solution) const {
  solution.bound = bound;
  solution.gap = gap;
  solution.nodes = nodes;
  solution.open_nodes = open_nodes;
  solution.reused_nodes = reused_nodes;
}

void TreeResult::measure(double objective) {
  bound = std::min(bound, objective);
  gap = relative_gap(objective, bound);
}

void TreeResult::answer_is(double objective, const Options& options) {
  measure(objective);
  proved = gap <= within(options);
  remark += std::string(", for the answer, feasible to the tolerances only: ") +
            (proved ? "proved" : "not proved") + ", gap " + scientific(gap, 1);
}

// Nodes whose bound is not below this are closed.
double Tree::cutoff() const {
  if (!incumbent_.exists()) return kInfinity;
  const double objective = problem_.user_objective(incumbent_.best().objective);
  const double least =
      objective - tuning::tree_within_gap * within(options_) * std::max(1.0, std::abs(objective));
  return (least - problem_.c0) * problem_.cost_scale;
}

// The bound for all feasible points: of open nodes, of closed ones and, since these are not below their
// cutoff, the incumbent. In the user's units, with the rounding of the conversion.
double Tree::bound() const {
  double least = closed_bound_;
  if (!open_.empty()) least = std::min(least, open_.front().bound);
  const double user = least / problem_.cost_scale;
  const double rounded =
      user + problem_.c0 - tuning::bound_roundoff * (std::abs(user) + std::abs(problem_.c0));
  const double objective =
      incumbent_.exists() ? problem_.user_objective(incumbent_.best().objective) : kInfinity;
  return std::min(std::isfinite(least) ? rounded : least, objective);
}

double Tree::gap(double bound) const {
  if (!incumbent_.exists()) return kInfinity;
  return relative_gap(problem_.user_objective(incumbent_.best().objective), bound);
}

TreeResult Tree::result(TreeResult::End end) const {
  TreeResult result;
  result.end = end;
  result.ray = ray_;
  result.bound = bound();
  result.gap = gap(result.bound);
  result.reused_nodes = reused_nodes_;
  result.nodes = nodes_;
  result.open_nodes = static_cast<std::int64_t>(open_.size());
  if (end == TreeResult::End::exhausted && !incumbent_.exists() && closed_bound_ == kInfinity)
    result.end = TreeResult::End::infeasible;
  result.proved = result.end == TreeResult::End::infeasible || result.gap <= within(options_);
  if (end == TreeResult::End::unbounded) {
    result.bound = -kInfinity;
    result.gap = kInfinity;
    result.proved = true;
    result.remark = "unbounded, by " + std::to_string(nodes_) + " nodes";
    return result;
  }
  result.remark = (result.proved ? "proved by " : "not proved by ") + std::to_string(nodes_) + " nodes, " +
                  std::to_string(result.open_nodes) + " open" +
                  (box_->is_bounded() ? "" : ", for |z| <= " + scientific(radius_, 1)) + ": bound " +
                  general(result.bound, 9) + ", gap " + scientific(result.gap, 1);
  if (reused_nodes_ > 0) {
    result.remark += ", from " + std::to_string(reused_nodes_) + " nodes of the last tree, " +
                     std::to_string(warm_closed_) + " still closed";
  }
  return result;
}

TreeResult Tree::stopped(Run& run) const {
  TreeResult result = this->result(TreeResult::End::limit);
  const auto reason = run.interrupted();
  result.limit = reason.value_or(Status::iteration_limit);
  if (!reason)
    result.remark += nodes_ + 2 > options_.node_limit ? "; node_limit" : "; no memory for more nodes";
  return result;
}

// A node without a proof of its own, such as the root of a stopped tree, proves nothing.
void Tree::record(const Node& leaf) const {
  Fixings fixings;
  std::vector<Index> held, s_zero, t_zero;
  leaf.read(problem_.layout, fixings, held);
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    if (has_s(fixings[static_cast<std::size_t>(pair)])) s_zero.push_back(pair);
    if (has_t(fixings[static_cast<std::size_t>(pair)])) t_zero.push_back(pair);
  }
  const LeafMultipliers nothing{false, Vector::Zero(problem_.variables()),
                                Vector::Zero(problem_.equalities()), Vector::Zero(problem_.layout.size()),
                                0.0};
  add_leaf(*proof_, std::move(s_zero), std::move(t_zero),
           leaf_of(problem_, leaf.record ? *leaf.record : nothing));
  if (!box_->is_bounded()) proof_->radius = radius_;
}

void Tree::report(Run& run) {
  reported_bound_ = std::max(reported_bound_, bound());
  run.set_done(Phase::tree, nodes_);
  if (run.activity() != nullptr) run.activity()->set_gap(gap(reported_bound_));
  if (incumbent_.exists()) run.add_incumbent(problem_.user_objective(incumbent_.best().objective));
  if (run.sink() == nullptr) return;
  Progress row;
  row.step_length = 1.0;
  row.bound = reported_bound_;
  row.gap = gap(reported_bound_);
  row.nodes = nodes_;
  row.open_nodes = static_cast<std::int64_t>(open_.size());
  if (incumbent_.exists()) row.incumbent = problem_.user_objective(incumbent_.best().objective);
  run.reported_iteration = -1;
  if (incumbent_.exists()) {
    reporter_.report(run, incumbent_.best().x.z(), incumbent_.best().objective, incumbent_.best().violations,
                     row);
  } else {
    point_.x.z() = center_.z;
    point_.images.evaluate(problem_, point_.x);
    reporter_.report(run, center_.z, point_.images.objective, violations(problem_, point_.images), row);
  }
}

}  // namespace marble
