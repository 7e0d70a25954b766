#include "proof/proof.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "branch/branch_engines.h"
#include "model/tuning.h"
#include "path/termination.h"
#include "proof/row_problem.h"

namespace marble {
namespace {

// Appends all rows of Q, as equalities.
void append_rows(const SymmetricMatrix& Q, RowMatrix& to) {
  std::vector<std::vector<std::pair<Index, double>>> rows(static_cast<std::size_t>(Q.size));
  for (Index column = 0; column < Q.size; ++column) {
    for (Index k = Q.column_pointers[column]; k < Q.column_pointers[column + 1]; ++k) {
      const Index row = Q.row_indices[k];
      rows[static_cast<std::size_t>(row)].emplace_back(column, Q.values[k]);
      if (row != column) rows[static_cast<std::size_t>(column)].emplace_back(row, Q.values[k]);
    }
  }
  for (auto& row : rows) {
    if (row.empty()) continue;
    std::sort(row.begin(), row.end());
    for (const auto& [column, value] : row) {
      to.column_indices.push_back(column);
      to.values.push_back(value);
    }
    to.row_pointers.push_back(static_cast<Index>(to.values.size()));
    ++to.rows;
  }
}

// The rows of one branch of p, with cost ½zᵀz. Gives the point of the branch's polyhedron that is nearest to
// −g or, with the offsets b and d at 0, the point of its recession cone.
class Branch {
 public:
  Branch(const Branch&) = delete;
  Branch& operator=(const Branch&) = delete;
  Branch(const ScaledProblem& p, const WorkingSet& set, bool flat) : problem_(empty_problem(p.variables())) {
    problem_.Q = identity(p.variables());
    append_rows(p.A, problem_.A);
    std::vector<double> b(p.b.data(), p.b.data() + p.b.size());
    std::vector<double> d;
    for (Index i = 0; i < p.pairs(); ++i) {
      append_row(p.rows, set.fixed_row(i), problem_.A);
      b.push_back(p.offset[set.fixed_row(i)]);
    }
    set.for_each_free_row([&](Index row) {
      append_row(p.rows, row, problem_.rows);
      d.push_back(p.offset[row]);
    });
    problem_.layout.inequalities = problem_.rows.rows;
    if (flat) append_rows(p.Q, problem_.A);
    b.resize(static_cast<std::size_t>(problem_.A.rows), 0.0);
    b_ = Eigen::Map<const Vector>(b.data(), static_cast<Index>(b.size()));
    d_ = Eigen::Map<const Vector>(d.data(), static_cast<Index>(d.size()));
    problem_.b = Vector::Zero(b_.size());
    problem_.offset = Vector::Zero(d_.size());
    problem_.variable_scale = p.variable_scale;
    problem_.equality_scale = Vector::Ones(b_.size());
    problem_.row_scale = Vector::Ones(d_.size());
  }

  /// Returns the point of the cone nearest to `target`, or nothing if that fails.
  std::optional<Vector> nearest_direction(Run& run, ConstVectorRef target) {
    problem_.b.setZero();
    problem_.offset.setZero();
    return nearest(run, target);
  }

  std::optional<Vector> nearest_point(Run& run, ConstVectorRef target) {
    problem_.b = b_;
    problem_.offset = d_;
    return nearest(run, target);
  }

  /// Returns multipliers of the polyhedron's equalities and rows that prove it empty.
  std::optional<FarkasProof> contradiction(Run& run) {
    problem_.b = b_;
    problem_.offset = d_;
    return prove_infeasible(problem_, Vector::Zero(problem_.variables()), run);
  }

 private:
  std::optional<Vector> nearest(Run& run, ConstVectorRef target) {
    const std::unique_ptr<Kkt> kkt = make_system(problem_, run);
    if (kkt == nullptr) return std::nullopt;
    BranchEngines engines(problem_, *kkt);
    problem_.g = -target;
    engines.point.start_from_point(target);
    if (!engines.exact.solve(run, tuning::engine_budget) || !engines.point.sharpen()) return std::nullopt;
    return Vector(engines.point.x.z());
  }

  ScaledProblem problem_;
  Vector b_, d_;  // of the polyhedron
};

// Returns the branch that z is nearest to.
WorkingSet branch_at(const ScaledProblem& p, ConstVectorRef z) {
  Vector value(p.layout.size());
  multiply(p.rows, z, value);
  value += p.offset;
  WorkingSet set(p);
  for (Index i = 0; i < p.pairs(); ++i) set.fix(i, value[p.layout.s(i)] < value[p.layout.t(i)], false);
  return set;
}

std::optional<Vector> feasible_point(const ScaledProblem& p, const Options& options, const WorkingSet& set,
                                     ConstVectorRef target, Run& run) {
  std::optional<Vector> point = Branch(p, set, false).nearest_point(run, target);
  if (!point) return std::nullopt;
  Iterate x(p);
  x.z() = *point;
  Images images(p);
  images.evaluate(p, x);
  if (!within_tolerances(violations(p, images), options)) return std::nullopt;
  return point;
}

// Searches along the direction nearest to `target`, from the feasible point nearest to 0: far away, rounding
// would hide a ray.
std::optional<UnboundedRay> find_ray(const ScaledProblem& p, const Options& options, const WorkingSet& set,
                                     bool flat, ConstVectorRef target, Run& run) {
  const double size = max_abs(target);
  if (size == 0.0) return std::nullopt;
  const std::optional<Vector> nearest = Branch(p, set, flat).nearest_direction(run, target / size);
  if (!nearest) return std::nullopt;
  std::optional<std::vector<double>> proved = unbounded_direction(p, *nearest);
  if (!proved) return std::nullopt;
  const std::optional<Vector> origin = feasible_point(p, options, set, Vector::Zero(p.variables()), run);
  if (!origin) return std::nullopt;
  return UnboundedRay{*origin, std::move(*proved)};
}

}  // namespace

std::optional<FarkasProof> prove_infeasible(const ScaledProblem& p, ConstVectorRef z, Run& run) {
  ScaledProblem relaxed = empty_problem(p.variables());
  relaxed.A = p.A;
  relaxed.b = p.b;
  relaxed.rows = p.rows;
  relaxed.offset = p.offset;
  relaxed.layout.inequalities = p.layout.size();  // every side of a pair, without complementarity
  const std::unique_ptr<Kkt> kkt = make_system(relaxed, run);
  if (kkt == nullptr) return std::nullopt;
  BranchEngines engines(relaxed, *kkt);
  engines.point.start_from_point(z);
  if (!engines.elastic.solve(run, tuning::middle_rho, ElasticRelaxation::Rows::violated,
                             tuning::engine_budget))
    return std::nullopt;
  return prove_contradiction(p, relaxed, *kkt, engines.point);
}

// r = Aᵀy + Cᵀλ equals the force of the proximal term, not 0. The current factor is that of the elastic
// system M = δI + ρ(AᵀA + CᵀC over violated and fixed rows): with M x = r, y − ρAx and λ − ρCx reduce r to
// δx.
std::optional<FarkasProof> prove_contradiction(const ScaledProblem& p, const ScaledProblem& relaxed, Kkt& kkt,
                                               const BranchPoint& point) {
  const Iterate& elastic = point.x;
  Vector y = elastic.y();
  Vector lambda = elastic.lambda();
  Vector residual(p.variables());
  Vector moved(relaxed.rows.rows);
  Vector equality(relaxed.A.rows);
  std::vector<std::uint8_t> zero(static_cast<std::size_t>(relaxed.rows.rows));
  for (Index row = 0; row < relaxed.rows.rows; ++row)
    zero[static_cast<std::size_t>(row)] = point.set.is_fixed(row);
  for (int i = 0; i < tuning::exact_sweeps; ++i) {
    residual.setZero();
    add_transposed(relaxed.A, y, residual);
    add_transposed(relaxed.rows, lambda, residual);
    equality.setZero();
    if (!kkt.solve(residual, equality)) return std::nullopt;  // ρAx is the second half of the solution
    y -= equality;
    multiply(relaxed.rows, residual, moved);
    for (Index row = 0; row < relaxed.rows.rows; ++row) {
      double& multiplier = lambda[row];
      if (zero[static_cast<std::size_t>(row)] != 0) {
        multiplier -= tuning::middle_rho * moved[row];
      } else if (multiplier < 0.0) {
        multiplier = std::min(multiplier - tuning::middle_rho * moved[row], 0.0);
      }
    }
  }
  Iterate x(p);
  x.z() = elastic.z();
  x.y() = y;
  x.lambda() = lambda.head(p.layout.size());
  return infeasibility_certificate(p, x, zero);
}

std::optional<Vector> feasible_point(const ScaledProblem& p, const Options& options, ConstVectorRef z,
                                     ConstVectorRef target, Run& run) {
  return feasible_point(p, options, branch_at(p, z), target, run);
}

std::optional<UnboundedRay> prove_unbounded(const ScaledProblem& p, const Options& options, ConstVectorRef z,
                                            ConstVectorRef direction, Run& run) {
  if (!z.allFinite() || !direction.allFinite()) return std::nullopt;
  const WorkingSet set = branch_at(p, z);
  std::optional<UnboundedRay> ray = find_ray(p, options, set, true, -p.g, run);
  if (!ray && !p.Q.values.empty()) ray = find_ray(p, options, set, false, direction, run);
  return ray;
}

std::optional<UnboundedRay> prove_branch_unbounded(const ScaledProblem& p, const Options& options,
                                                   const WorkingSet& branch, Run& run) {
  return find_ray(p, options, branch, true, -p.g, run);
}

std::optional<LeafMultipliers> branch_contradiction(const ScaledProblem& p, const WorkingSet& branch,
                                                    Run& run) {
  const std::optional<FarkasProof> proof = Branch(p, branch, false).contradiction(run);
  if (!proof) return std::nullopt;
  LeafMultipliers found{true, {}, Vector(p.equalities()), Vector(p.layout.size())};
  auto next = proof->multipliers.begin();
  for (double& y : found.y) y = *next++;
  for (Index pair = 0; pair < p.pairs(); ++pair) found.rows[branch.fixed_row(pair)] = -*next++;
  branch.for_each_free_row([&](Index row) { found.rows[row] = *next++; });
  return found;
}

}  // namespace marble
