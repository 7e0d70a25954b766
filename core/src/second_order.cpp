#include "second_order.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

namespace marble {
namespace {

constexpr double kZero = 1e-8;       // of slacks; of multipliers relative to the largest
constexpr double kCurvature = 1e-7;  // of vᵀQv relative to vᵀv: less is taken for 0, as δ takes it
constexpr std::size_t kMostWeak = 10;
constexpr double kNoWeight = 1e-12;  // of the equality rows

// A weakly active row: an inequality, or a side of a pair with both sides at zero.
struct WeakRow {
  enum class Kind { inequality, left, right } kind;
  Index index;
  bool stays_in_set;  // the exact solution held it at zero
};

struct ActiveRows {
  std::vector<WeakRow> weak;
  WorkingSet all;
};

ActiveRows active_rows(const ScaledProblem& p, const Iterate& x, const WorkingSet& set) {
  Images images(p);
  images.evaluate(p, x);
  const double zero =
      kZero * (1.0 + std::max({max_abs(x.lambda_w()), max_abs(x.lambda_L()), max_abs(x.lambda_R())}));
  ActiveRows rows{{}, set};
  for (Index i = 0; i < p.inequalities(); ++i) {
    const bool held = set.active_inequality[static_cast<std::size_t>(i)] != 0;
    if (!held && images.inequality[i] > kZero) continue;
    rows.all.active_inequality[static_cast<std::size_t>(i)] = 1;
    if (std::abs(x.lambda_w()[i]) <= zero) rows.weak.push_back({WeakRow::Kind::inequality, i, held});
  }
  for (Index i = 0; i < p.pairs(); ++i) {
    const auto pair = static_cast<std::size_t>(i);
    const bool both_held = set.active_free_side[pair] != 0;
    if (!both_held && std::max(images.left[i], images.right[i]) > kZero) continue;
    rows.all.active_free_side[pair] = 1;
    const bool left_held = both_held || set.left_fixed[pair] != 0;
    const bool right_held = both_held || set.left_fixed[pair] == 0;
    if (std::abs(x.lambda_L()[i]) <= zero) rows.weak.push_back({WeakRow::Kind::left, i, left_held});
    if (std::abs(x.lambda_R()[i]) <= zero) rows.weak.push_back({WeakRow::Kind::right, i, right_held});
  }
  return rows;
}

double& offset_of(ScaledProblem& p, const WeakRow& row) {
  if (row.kind == WeakRow::Kind::inequality) return p.d[row.index];
  return row.kind == WeakRow::Kind::left ? p.l[row.index] : p.r[row.index];
}

// Column k moves weak row k by one, keeps all other active rows, and has the least curvature of those that
// do.
std::optional<Eigen::MatrixXd> unit_moves(const ScaledProblem& p, Kkt& kkt, const ActiveRows& rows,
                                          Run& run) {
  ScaledProblem homogeneous = p;
  for (Vector* vector : {&homogeneous.g, &homogeneous.b, &homogeneous.d, &homogeneous.l, &homogeneous.r})
    vector->setZero();
  ActiveSet active_set(homogeneous, kkt);
  active_set.set_working_set(rows.all);
  if (!active_set.factor(run, ActiveSet::kExactRho, ActiveSet::kExactDelta)) return std::nullopt;
  const Iterate origin(p);
  Eigen::MatrixXd moves(p.variables(), static_cast<Eigen::Index>(rows.weak.size()));
  for (std::size_t k = 0; k < rows.weak.size(); ++k) {
    double& offset = offset_of(homogeneous, rows.weak[k]);
    offset = -1.0;
    active_set.restore(origin, rows.all);
    if (!active_set.sharpen()) return std::nullopt;
    moves.col(static_cast<Eigen::Index>(k)) = active_set.x().z();
    offset = 0.0;
  }
  return moves;
}

// A subset of the weak rows, by bits, may grow together if no pair has both of its sides in it.
bool belongs_to_a_branch(const std::vector<WeakRow>& weak, unsigned subset) {
  for (std::size_t k = 1; k < weak.size(); ++k) {
    const bool one_pair = weak[k].kind == WeakRow::Kind::right && weak[k - 1].kind == WeakRow::Kind::left &&
                          weak[k].index == weak[k - 1].index;
    if (one_pair && (subset >> (k - 1) & 3U) == 3U) return false;
  }
  return true;
}

void release(const std::vector<WeakRow>& weak, unsigned subset, WorkingSet& set) {
  for (std::size_t k = 0; k < weak.size(); ++k) {
    if ((subset >> k & 1U) == 0) continue;
    const auto index = static_cast<std::size_t>(weak[k].index);
    if (weak[k].kind == WeakRow::Kind::inequality) {
      set.active_inequality[index] = 0;
    } else {
      set.active_free_side[index] = 0;
      set.left_fixed[index] = weak[k].kind == WeakRow::Kind::right;
    }
  }
}

}  // namespace

bool diagonally_dominant(const ScaledProblem& p) {
  // In the user's units, where (z₁ − z₂)² still has a row that adds up to 0.
  Vector off_diagonal = Vector::Zero(p.variables());
  Vector diagonal = Vector::Zero(p.variables());
  for (Index column = 0; column < p.Q.size; ++column) {
    for (Index k = p.Q.column_pointers[column]; k < p.Q.column_pointers[column + 1]; ++k) {
      const Index row = p.Q.row_indices[k];
      const double value = p.Q.values[k] / (p.variable_scale[row] * p.variable_scale[column]);
      if (row == column) {
        diagonal[row] = value;
      } else {
        off_diagonal[row] += std::abs(value);
        off_diagonal[column] += std::abs(value);
      }
    }
  }
  return (diagonal.array() * (1.0 + 1e-13) >= off_diagonal.array()).all();
}

bool convex_by_inertia(const ScaledProblem& p, Kkt& kkt) {
  RowWeights weights(p);
  weights.rho = kNoWeight;
  weights.delta = ActiveSet::kExactDelta;
  weights.inequality.setZero();
  weights.first.setZero();
  weights.second.setZero();
  weights.cosine.setOnes();
  weights.sine.setZero();
  return kkt.factor(weights);
}

bool has_weakly_active_rows(const ScaledProblem& p, const Iterate& x, const WorkingSet& set) {
  const ActiveRows rows = active_rows(p, x, set);
  return std::any_of(rows.weak.begin(), rows.weak.end(), [](const WeakRow& row) { return row.stays_in_set; });
}

CriticalCurvature critical_curvature(const ScaledProblem& p, Kkt& kkt, const Iterate& x,
                                     const WorkingSet& set, Run& run) {
  const ActiveRows rows = active_rows(p, x, set);
  const bool none_held =
      std::none_of(rows.weak.begin(), rows.weak.end(), [](const WeakRow& row) { return row.stays_in_set; });
  CriticalCurvature result{SecondOrder::minimum, {}, rows.all};
  if (none_held) return result;
  result.kind = SecondOrder::necessary;
  if (rows.weak.size() > kMostWeak) return result;
  const std::optional<Eigen::MatrixXd> moves = unit_moves(p, kkt, rows, run);
  if (!moves) return result;
  Eigen::MatrixXd images(p.variables(), moves->cols());
  for (Eigen::Index k = 0; k < moves->cols(); ++k) {
    Vector image(p.variables());
    multiply(p.Q, moves->col(k), image);
    images.col(k) = image;
  }
  const Eigen::MatrixXd reduced = moves->transpose() * images;
  // Kaplan, "A test for copositive matrices", 2000: copositive unless a principal submatrix has a positive
  // eigenvector with a negative eigenvalue.
  std::vector<Eigen::Index> members;
  for (unsigned subset = 1; subset < 1U << rows.weak.size(); ++subset) {
    if (!belongs_to_a_branch(rows.weak, subset)) continue;
    members.clear();
    for (std::size_t k = 0; k < rows.weak.size(); ++k) {
      if ((subset >> k & 1U) != 0) members.push_back(static_cast<Eigen::Index>(k));
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(reduced(members, members));
    for (Eigen::Index k = 0; k < eigen.eigenvalues().size() && eigen.eigenvalues()[k] < 0.0; ++k) {
      Vector growth = eigen.eigenvectors().col(k);
      if (growth.sum() < 0.0) growth = -growth;
      if (!(growth.minCoeff() > 0.0)) continue;
      const Vector direction = (*moves)(Eigen::all, members) * growth;
      if (eigen.eigenvalues()[k] > -kCurvature * direction.squaredNorm()) continue;
      result.kind = SecondOrder::saddle;
      result.direction = direction;
      release(rows.weak, subset, result.set);
      return result;
    }
  }
  result.kind = SecondOrder::minimum;
  return result;
}

}  // namespace marble
