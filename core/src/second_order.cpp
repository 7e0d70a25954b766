#include "second_order.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "tuning.h"

namespace marble {
namespace {

// An active row: an inequality, or a side of a pair with both sides at zero.
struct ActiveRow {
  enum class Kind { inequality, left, right } kind;
  Index index;
};

const RowMatrix& matrix_of(const ScaledProblem& p, const ActiveRow& row) {
  if (row.kind == ActiveRow::Kind::inequality) return p.C;
  return row.kind == ActiveRow::Kind::left ? p.L : p.R;
}

double& offset_of(ScaledProblem& p, const ActiveRow& row) {
  if (row.kind == ActiveRow::Kind::inequality) return p.d[row.index];
  return row.kind == ActiveRow::Kind::left ? p.l[row.index] : p.r[row.index];
}

// The positive factor between two rows, 0 if there is none.
double ratio(const RowMatrix& a, Index row_a, const RowMatrix& b, Index row_b) {
  const Index size = a.row_size(row_a);
  if (size == 0 || size != b.row_size(row_b)) return 0.0;
  const Index at = a.row_pointers[row_a];
  const Index bt = b.row_pointers[row_b];
  const double factor = a.values[at] / b.values[bt];
  if (!(factor > 0.0)) return 0.0;
  for (Index k = 0; k < size; ++k) {
    if (a.column_indices[at + k] != b.column_indices[bt + k] ||
        std::abs(a.values[at + k] - factor * b.values[bt + k]) >
            tuning::rounding * std::abs(a.values[at + k]))
      return 0.0;
  }
  return factor;
}

// Weakly active rows, those that are multiples of each other in one group: they move together.
struct ActiveRows {
  std::vector<std::vector<ActiveRow>> weak;
  WorkingSet all;
  bool some_held = false;  // the exact solution held one of them at zero
};

class ActiveRowFinder {
 public:
  ActiveRowFinder(const ScaledProblem& p, const Iterate& x, const WorkingSet& set)
      : p_(p), x_(x), set_(set), images_(p), rows_{{}, set} {
    images_.evaluate(p, x);
    zero_ = tuning::zero *
            (1.0 + std::max({max_abs(x.lambda_w()), max_abs(x.lambda_L()), max_abs(x.lambda_R())}));
  }

  ActiveRows find() {
    for (Index i = 0; i < p_.equalities(); ++i) strong_.emplace_back(&p_.A, i);
    for (Index i = 0; i < p_.inequalities(); ++i) {
      std::uint8_t& active = rows_.all.active_inequality[static_cast<std::size_t>(i)];
      const bool held = active != 0;
      if (!held && images_.inequality[i] > tuning::zero) continue;
      active = 1;
      add({ActiveRow::Kind::inequality, i}, x_.lambda_w()[i], held);
    }
    for (Index i = 0; i < p_.pairs(); ++i) {
      const auto pair = static_cast<std::size_t>(i);
      const bool left_fixed = set_.left_fixed[pair] != 0;
      const bool both_held = set_.active_free_side[pair] != 0;
      if (!both_held && std::max(images_.left[i], images_.right[i]) > tuning::zero) {
        strong_.emplace_back(left_fixed ? &p_.L : &p_.R, i);
        continue;
      }
      rows_.all.active_free_side[pair] = 1;
      add({ActiveRow::Kind::left, i}, x_.lambda_L()[i], both_held || left_fixed);
      add({ActiveRow::Kind::right, i}, x_.lambda_R()[i], both_held || !left_fixed);
    }
    return std::move(rows_);
  }

  // Rows that are multiples of a row that stays at zero stay there too.
  [[nodiscard]] std::vector<std::vector<ActiveRow>> group(
      const std::vector<std::vector<ActiveRow>>& weak) const {
    std::vector<std::vector<ActiveRow>> groups;
    for (const auto& single : weak) {
      const ActiveRow& row = single.front();
      const RowMatrix& matrix = matrix_of(p_, row);
      const auto parallel = [&](const auto& strong) {
        return ratio(matrix, row.index, *strong.first, strong.second) > 0.0;
      };
      if (std::any_of(strong_.begin(), strong_.end(), parallel)) continue;
      const auto alike = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
        return ratio(matrix, row.index, matrix_of(p_, group.front()), group.front().index) > 0.0;
      });
      if (alike == groups.end()) {
        groups.push_back({row});
      } else {
        alike->push_back(row);
      }
    }
    return groups;
  }

 private:
  void add(const ActiveRow& row, double multiplier, bool held) {
    if (std::abs(multiplier) > zero_) {
      strong_.emplace_back(&matrix_of(p_, row), row.index);
      return;
    }
    rows_.weak.push_back({row});
    rows_.some_held = rows_.some_held || held;
  }

  const ScaledProblem& p_;
  const Iterate& x_;
  const WorkingSet& set_;
  Images images_;
  double zero_ = 0.0;
  ActiveRows rows_;
  std::vector<std::pair<const RowMatrix*, Index>> strong_;
};

// Column k moves the weak rows of group k by one, keeps all other active rows, and has the least curvature of
// those that do.
std::optional<Eigen::MatrixXd> unit_moves(const ScaledProblem& p, Kkt& kkt, const ActiveRows& rows,
                                          Run& run) {
  ScaledProblem homogeneous = p;
  for (Vector* vector : {&homogeneous.g, &homogeneous.b, &homogeneous.d, &homogeneous.l, &homogeneous.r})
    vector->setZero();
  ActiveSet active_set(homogeneous, kkt);
  active_set.set_working_set(rows.all);
  if (!active_set.factor(run, tuning::exact_rho, tuning::exact_delta)) return std::nullopt;
  const Iterate origin(p);
  Eigen::MatrixXd moves(p.variables(), static_cast<Eigen::Index>(rows.weak.size()));
  for (std::size_t k = 0; k < rows.weak.size(); ++k) {
    const ActiveRow& first = rows.weak[k].front();
    for (const ActiveRow& row : rows.weak[k])
      offset_of(homogeneous, row) = -ratio(matrix_of(p, row), row.index, matrix_of(p, first), first.index);
    active_set.restore(origin, rows.all);
    if (!active_set.sharpen()) return std::nullopt;
    moves.col(static_cast<Eigen::Index>(k)) = active_set.x().z();
    for (const ActiveRow& row : rows.weak[k]) offset_of(homogeneous, row) = 0.0;
  }
  return moves;
}

// Lets the rows of a subset of the groups (by bits) grow. False if that would open both sides of a pair.
bool release(const ActiveRows& rows, unsigned subset, WorkingSet& set) {
  for (std::size_t k = 0; k < rows.weak.size(); ++k) {
    if ((subset >> k & 1U) == 0) continue;
    for (const ActiveRow& row : rows.weak[k]) {
      const auto index = static_cast<std::size_t>(row.index);
      if (row.kind == ActiveRow::Kind::inequality) {
        set.active_inequality[index] = 0;
      } else {
        if (set.active_free_side[index] == 0) return false;
        set.active_free_side[index] = 0;
        set.left_fixed[index] = row.kind == ActiveRow::Kind::right;
      }
    }
  }
  return true;
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
  return (diagonal.array() * (1.0 + tuning::diagonal_rounding) >= off_diagonal.array()).all();
}

bool convex_by_inertia(const ScaledProblem& p, Kkt& kkt) {
  RowWeights weights(p);
  weights.rho = tuning::rounding;
  weights.delta = tuning::exact_delta;
  weights.inequality.setZero();
  weights.first.setZero();
  weights.second.setZero();
  weights.cosine.setOnes();
  weights.sine.setZero();
  return kkt.factor(weights);
}

bool has_weakly_active_rows(const ScaledProblem& p, const Iterate& x, const WorkingSet& set) {
  return ActiveRowFinder(p, x, set).find().some_held;
}

CriticalCurvature critical_curvature(const ScaledProblem& p, Kkt& kkt, const Iterate& x,
                                     const WorkingSet& set, Run& run) {
  ActiveRowFinder finder(p, x, set);
  ActiveRows rows = finder.find();
  CriticalCurvature result{SecondOrder::minimum, {}, rows.all};
  if (!rows.some_held) return result;
  result.kind = SecondOrder::necessary;
  if (rows.weak.size() > tuning::weak_rows_grouped) return result;
  rows.weak = finder.group(rows.weak);
  if (rows.weak.size() > tuning::weak_rows) return result;
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
    WorkingSet released = rows.all;
    if (!release(rows, subset, released)) continue;
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
      if (eigen.eigenvalues()[k] > -tuning::curvature * direction.squaredNorm()) continue;
      result.kind = SecondOrder::saddle;
      result.direction = direction;
      result.set = released;
      return result;
    }
  }
  result.kind = SecondOrder::minimum;
  return result;
}

}  // namespace marble
