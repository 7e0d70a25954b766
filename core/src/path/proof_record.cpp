#include "path/proof_record.h"

#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <utility>

namespace marble {
namespace {

SparseNumbers sparse(std::span<const double> values) {
  SparseNumbers result;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] == 0.0) continue;
    result.indices.push_back(static_cast<Index>(i));
    result.values.push_back(values[i]);
  }
  return result;
}

SparseNumbers sparse(const Vector& values) {
  return sparse(std::span(values.data(), static_cast<std::size_t>(values.size())));
}

}  // namespace

void clear_leaves(Proof& proof) {
  proof.leaves.clear();
  proof.bytes = 0;
  proof.radius = std::numeric_limits<double>::infinity();
}

std::int64_t bytes_of(const ProofLeaf& leaf) {
  std::size_t numbers = 0;
  for (const SparseNumbers* part : {&leaf.z, &leaf.y, &leaf.nu, &leaf.xi, &leaf.eta})
    numbers += part->values.size();
  return static_cast<std::int64_t>(sizeof(ProofLeaf) + (sizeof(double) + sizeof(Index)) * numbers +
                                   sizeof(Index) * (leaf.s_zero.size() + leaf.t_zero.size()));
}

ProofLeaf leaf_of(const ScaledProblem& p, const LeafMultipliers& multipliers) {
  const double cost = multipliers.contradiction ? 1.0 : 1.0 / p.cost_scale;
  ProofLeaf leaf;
  leaf.contradiction = multipliers.contradiction;
  if (!leaf.contradiction) leaf.z = sparse(multipliers.z.cwiseProduct(p.variable_scale));
  leaf.y = sparse(cost * multipliers.y.cwiseProduct(p.equality_scale));
  const Vector rows = cost * multipliers.rows.cwiseProduct(p.row_scale);
  leaf.nu = sparse(rows.head(p.inequalities()));
  leaf.xi = sparse(rows.segment(p.inequalities(), p.pairs()));
  leaf.eta = sparse(rows.tail(p.pairs()));
  return leaf;
}

void add_leaf(Proof& proof, std::vector<Index> s_zero, std::vector<Index> t_zero, ProofLeaf leaf) {
  leaf.s_zero = std::move(s_zero);
  leaf.t_zero = std::move(t_zero);
  proof.bytes += bytes_of(leaf);
  if (proof.bytes <= proof.most_bytes) {
    proof.leaves.push_back(std::move(leaf));
  } else {
    proof.leaves = {};
  }
}

void add_contradiction(Proof& proof, const ScaledProblem& p, std::vector<Index> s_zero,
                       std::vector<Index> t_zero, const std::vector<double>& multipliers) {
  ProofLeaf leaf;
  leaf.contradiction = true;
  std::span<const double> left = multipliers;
  const auto take = [&left](Index size) {
    const auto part = left.first(static_cast<std::size_t>(size));
    left = left.subspan(static_cast<std::size_t>(size));
    return sparse(part);
  };
  leaf.y = take(p.equalities());
  leaf.nu = take(p.inequalities());
  leaf.xi = take(p.pairs());
  leaf.eta = take(p.pairs());
  add_leaf(proof, std::move(s_zero), std::move(t_zero), std::move(leaf));
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
