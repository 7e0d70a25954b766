#include "global/pair_tree.h"

#include <algorithm>
#include <limits>

#include "model/tuning.h"
#include "proof/proof.h"
#include "proof/row_problem.h"

namespace marble {

namespace {

// Returns the problem of the relaxations. It has no cost. Its rows are [C; L; R], followed by as many empty
// rows as there are sides: each side forms a pair with 0.
ScaledProblem relaxation_of(const ScaledProblem& p) {
  ScaledProblem relaxed = empty_problem(p.variables());
  relaxed.A = p.A;
  relaxed.b = p.b;
  relaxed.rows = p.rows;
  relaxed.layout = {.inequalities = p.inequalities(), .pairs = 2 * p.pairs()};
  relaxed.rows.rows = relaxed.layout.size();
  relaxed.rows.row_pointers.resize(static_cast<std::size_t>(relaxed.layout.size()) + 1,
                                   p.rows.row_pointers.back());
  relaxed.offset = Vector::Zero(relaxed.layout.size());
  relaxed.offset.head(p.layout.size()) = p.offset;
  return relaxed;
}

}  // namespace

PairTree::PairTree(const ScaledProblem& problem) : problem_(problem) {}

double PairTree::fork_bytes() const {
  const double numbers =
      problem_.variables() + problem_.equalities() + 3.0 * (problem_.inequalities() + 4.0 * problem_.pairs());
  return sizeof(double) * numbers * problem_.pairs();
}

bool PairTree::prepare(Run& run) {
  if (kkt_ != nullptr) return true;
  if (fork_bytes() > std::min(tuning::tree_bytes, run.bytes_left)) return false;
  run.bytes_left -= fork_bytes();
  relaxed_ = relaxation_of(problem_);
  kkt_ = make_system(relaxed_, run);
  if (kkt_ == nullptr) return false;
  run.bytes_left -= system_bytes(relaxed_, *kkt_);
  engines_ = std::make_unique<BranchEngines>(relaxed_, *kkt_);
  return true;
}

bool PairTree::is_open(Index pair) const {
  const WorkingSet& set = engines_->point.set;
  return set.s_fixed[pair] == 0 && set.s_fixed[problem_.pairs() + pair] == 0;
}

Index PairTree::smaller_side(Index pair) const {
  const Vector& value = engines_->point.images.rows.all;
  return value[problem_.layout.s(pair)] < value[problem_.layout.t(pair)] ? pair : problem_.pairs() + pair;
}

void PairTree::fix(Index side) { engines_->point.set.fix(side, true, true); }

// Returns the open pair whose smaller side is largest; −1 if none is open.
Index PairTree::worst_pair(double& apart) const {
  Index worst = -1;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    if (!is_open(pair)) continue;
    const double value = engines_->point.images.rows.all[problem_.inequalities() + smaller_side(pair)];
    if (worst >= 0 && value <= apart) continue;
    worst = pair;
    apart = value;
  }
  return worst;
}

void PairTree::branch_of(WorkingSet& branch) const {
  const WorkingSet& set = engines_->point.set;
  for (Index row = 0; row < problem_.inequalities(); ++row) branch.held[row] = set.held[row];
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const bool s = is_open(pair) ? smaller_side(pair) == pair : set.s_fixed[pair] != 0;
    const Index free = s ? problem_.layout.t(pair) : problem_.layout.s(pair);
    branch.fix(pair, s, set.held[free] != 0);
  }
}

PairTree::Node PairTree::solve(Run& run, int last_factorization) {
  ++nodes_;
  const int budget = std::min(tuning::engine_budget, last_factorization - run.factorizations);
  ElasticRelaxation& elastic = engines_->elastic;
  const auto rows = nodes_ == 1 ? ElasticRelaxation::Rows::violated : ElasticRelaxation::Rows::held;
  if (!elastic.solve(run, tuning::middle_rho, rows, budget)) return Node::failed;
  const Iterate& x = engines_->point.x;
  if (std::max(max_abs(x.y()), max_abs(x.lambda())) <= tuning::near * tuning::middle_rho)
    return Node::feasible;
  const std::optional<FarkasProof> proof = prove_contradiction(problem_, relaxed_, *kkt_, engines_->point);
  proved_ = proved_ && proof;
  if (proof) radius_ = std::min(radius_, proof->radius);
  if (proof && run.proof() != nullptr) record(*run.proof(), *proof);
  return Node::cut;
}

void PairTree::record(Proof& proof, const FarkasProof& found) const {
  std::vector<Index> s_zero, t_zero;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    if (engines_->point.set.s_fixed[pair] != 0) s_zero.push_back(pair);
    if (engines_->point.set.s_fixed[problem_.pairs() + pair] != 0) t_zero.push_back(pair);
  }
  add_contradiction(proof, problem_, std::move(s_zero), std::move(t_zero), found.multipliers);
  proof.radius = radius_;
}

// Goes to the other child of the last fork. Returns false if there is none.
bool PairTree::back() {
  if (forks_.empty()) return false;
  engines_->point.restore(forks_.back().x, forks_.back().set);
  fix(forks_.back().side);
  forks_.pop_back();
  return true;
}

PairTree::End PairTree::run(Run& run, ConstVectorRef z, int last_factorization, const Accept& accept) {
  if (!prepare(run)) return End::stopped;
  kkt_->attend(run.interrupt());
  BranchPoint& point = engines_->point;
  point.set = WorkingSet(relaxed_);
  point.x.all.setZero();
  point.x.z() = z;
  forks_.clear();
  if (run.proof() != nullptr) clear_leaves(*run.proof());
  proved_ = true;
  radius_ = std::numeric_limits<double>::infinity();
  nodes_ = 0;
  WorkingSet branch(problem_);
  do {
    const Node node = solve(run, last_factorization);
    run.set_done(Phase::feasibility, nodes_);
    if (run.interrupted() || run.factorizations >= last_factorization) return End::stopped;
    if (node == Node::failed) proved_ = false;
    if (node != Node::feasible) continue;
    double apart = 0.0;
    const Index pair = worst_pair(apart);
    if (pair < 0 || apart <= tuning::near) {
      branch_of(branch);
      if (accept(point.x.z(), branch)) return End::found;
    }
    if (pair < 0) {
      proved_ = false;
      continue;
    }
    const Index side = smaller_side(pair);
    const Index other = side == pair ? problem_.pairs() + pair : pair;
    forks_.push_back({point.x, point.set, other});
    forks_.push_back({point.x, point.set, side});
  } while (back());
  return proved_ ? End::refuted : End::stopped;
}

}  // namespace marble
