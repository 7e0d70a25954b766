#include "run/proof_record.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>

namespace marble {
namespace {

std::vector<double> to_vector(ConstVectorRef values) {
  return {values.data(), values.data() + values.size()};
}

void add(Proof& proof, ProofLeaf leaf) {
  const std::size_t numbers =
      leaf.z.size() + leaf.y.size() + leaf.nu.size() + leaf.xi.size() + leaf.eta.size();
  proof.bytes += static_cast<std::int64_t>(sizeof(ProofLeaf) + sizeof(double) * numbers +
                                           sizeof(Index) * (leaf.s_zero.size() + leaf.t_zero.size()));
  if (proof.bytes <= proof.most_bytes) {
    proof.leaves.push_back(std::move(leaf));
  } else {
    proof.leaves = {};
  }
}

}  // namespace

void clear_leaves(Proof& proof) {
  proof.leaves.clear();
  proof.bytes = 0;
  proof.radius = std::numeric_limits<double>::infinity();
}

void add_leaf(Proof& proof, const ScaledProblem& p, std::vector<Index> s_zero, std::vector<Index> t_zero,
              const LeafMultipliers& multipliers) {
  const double cost = multipliers.contradiction ? 1.0 : 1.0 / p.cost_scale;
  ProofLeaf leaf;
  leaf.s_zero = std::move(s_zero);
  leaf.t_zero = std::move(t_zero);
  leaf.contradiction = multipliers.contradiction;
  if (!leaf.contradiction) leaf.z = to_vector(multipliers.z.cwiseProduct(p.variable_scale));
  leaf.y = to_vector(cost * multipliers.y.cwiseProduct(p.equality_scale));
  const Vector rows = cost * multipliers.rows.cwiseProduct(p.row_scale);
  leaf.nu = to_vector(rows.head(p.inequalities()));
  leaf.xi = to_vector(rows.segment(p.inequalities(), p.pairs()));
  leaf.eta = to_vector(rows.tail(p.pairs()));
  add(proof, std::move(leaf));
}

void add_contradiction(Proof& proof, const ScaledProblem& p, std::vector<Index> s_zero,
                       std::vector<Index> t_zero, const std::vector<double>& multipliers) {
  ProofLeaf leaf;
  leaf.s_zero = std::move(s_zero);
  leaf.t_zero = std::move(t_zero);
  leaf.contradiction = true;
  auto next = multipliers.begin();
  const auto take = [&next](std::vector<double>& part, Index size) {
    part.assign(next, next + size);
    next += size;
  };
  take(leaf.y, p.equalities());
  take(leaf.nu, p.inequalities());
  take(leaf.xi, p.pairs());
  take(leaf.eta, p.pairs());
  add(proof, std::move(leaf));
}

void conclude(Proof& proof, const ScaledProblem& problem, const Solution& solution) {
  const bool infeasible = solution.status == Status::infeasible;
  if (infeasible && !solution.certificate.empty()) {
    const double radius = proof.radius;
    clear_leaves(proof);
    proof.radius = radius;
    add_contradiction(proof, problem, {}, {}, solution.certificate);
  }
  proof.bound = solution.bound;
  proof.claim = Proof::Claim::none;
  if (proof.bytes > proof.most_bytes) {
    proof.reason = "its leaves take more than " + std::to_string(proof.most_bytes) + " bytes";
  } else if (!infeasible && !std::isfinite(solution.bound)) {
    proof.reason = "no bound of the objective is known";
  } else if (proof.leaves.empty()) {
    proof.reason = "nothing was recorded";
  } else {
    proof.reason.clear();
    proof.claim = infeasible ? Proof::Claim::infeasible : Proof::Claim::bound;
    return;
  }
  clear_leaves(proof);
}

}  // namespace marble
