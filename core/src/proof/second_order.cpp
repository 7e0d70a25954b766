#include "proof/second_order.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "model/tuning.h"

namespace marble {
namespace {

// Returns the positive factor between two rows, 0 if there is none.
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

// Weakly active rows. Rows that are multiples of each other form one group, because they move together.
struct ActiveRows {
  std::vector<std::vector<Index>> weak;
  WorkingSet all;
  bool some_held = false;  // the exact solution held one of them at zero
};

class ActiveRowFinder {
 public:
  ActiveRowFinder(const ScaledProblem& p, const Iterate& x, const WorkingSet& set)
      : p_(p), x_(x), set_(set), images_(p), rows_{{}, set} {
    images_.evaluate(p, x);
    zero_ = tuning::zero * (1.0 + max_abs(x.lambda()));
  }

  ActiveRows find() {
    for (Index i = 0; i < p_.equalities(); ++i) strong_.emplace_back(&p_.A, i);
    for (Index row = 0; row < p_.inequalities(); ++row) {
      const bool held = set_.held[row] != 0;
      if (!held && images_.rows.all[row] > tuning::zero) continue;
      rows_.all.held[row] = 1;
      add(row, held);
    }
    for (Index i = 0; i < p_.pairs(); ++i) {
      const Index s = p_.layout.s(i);
      const Index t = p_.layout.t(i);
      const bool both_held = set_.held[s] != 0 && set_.held[t] != 0;
      if (!both_held && std::max(images_.rows.all[s], images_.rows.all[t]) > tuning::zero) {
        strong_.emplace_back(&p_.rows, set_.fixed_row(i));
        continue;
      }
      rows_.all.held[s] = rows_.all.held[t] = 1;
      add(s, set_.held[s] != 0);
      add(t, set_.held[t] != 0);
    }
    return std::move(rows_);
  }

  // Groups the rows. A multiple of a row that stays at zero stays at zero too and is left out.
  [[nodiscard]] std::vector<std::vector<Index>> group(const std::vector<std::vector<Index>>& weak) const {
    std::vector<std::vector<Index>> groups;
    for (const auto& single : weak) {
      const Index row = single.front();
      const auto parallel = [&](const auto& strong) {
        return ratio(p_.rows, row, *strong.first, strong.second) > 0.0;
      };
      if (std::any_of(strong_.begin(), strong_.end(), parallel)) continue;
      const auto alike = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
        return ratio(p_.rows, row, p_.rows, group.front()) > 0.0;
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
  void add(Index row, bool held) {
    if (std::abs(x_.lambda()[row]) > zero_) {
      strong_.emplace_back(&p_.rows, row);
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
// all directions that do so.
std::optional<Eigen::MatrixXd> unit_moves(const ScaledProblem& p, Kkt& kkt, const ActiveRows& rows,
                                          Run& run) {
  ScaledProblem homogeneous = p;
  for (Vector* vector : {&homogeneous.g, &homogeneous.b, &homogeneous.offset}) vector->setZero();
  BranchPoint point(homogeneous, kkt);
  point.set = rows.all;
  if (!point.factor(run, tuning::exact_rho, tuning::exact_delta)) return std::nullopt;
  const Iterate origin(p);
  Eigen::MatrixXd moves(p.variables(), static_cast<Eigen::Index>(rows.weak.size()));
  for (std::size_t k = 0; k < rows.weak.size(); ++k) {
    for (const Index row : rows.weak[k])
      homogeneous.offset[row] = -ratio(p.rows, row, p.rows, rows.weak[k].front());
    point.restore(origin, rows.all);
    if (!point.sharpen()) return std::nullopt;
    moves.col(static_cast<Eigen::Index>(k)) = point.x.z();
    for (const Index row : rows.weak[k]) homogeneous.offset[row] = 0.0;
  }
  return moves;
}

// Lets the rows of a subset of the groups (given by bits) grow. Returns false if that would release both
// sides of a pair.
bool release(const ActiveRows& rows, unsigned subset, WorkingSet& set) {
  for (std::size_t k = 0; k < rows.weak.size(); ++k) {
    if ((subset >> k & 1U) == 0) continue;
    for (const Index row : rows.weak[k]) {
      if (row < set.layout.inequalities) {
        set.held[row] = 0;
      } else {
        const Index pair = set.layout.pair_of(row);
        if (set.held[set.free_row(pair)] == 0) return false;
        set.fix(pair, !set.layout.is_s(row), false);
      }
    }
  }
  return true;
}

}  // namespace

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
  if (std::ssize(rows.weak) > tuning::rows_apart) return result;
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
  // Kaplan, "A test for copositive matrices", 2000: a matrix is copositive unless a principal submatrix has a
  // positive eigenvector with a negative eigenvalue.
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
      if (eigen.eigenvalues()[k] > -tuning::zero * direction.squaredNorm()) continue;
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
