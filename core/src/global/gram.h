// The convex relaxations of all nodes in terms of their rows: G = J K⁻¹ Jᵀ, the effect of a unit multiplier
// of one row on the slacks of all. K, the root's system with Q, the equalities and the proximal term, is the
// same for every node. A column is therefore computed once per tree, when its row first becomes active.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "kkt/kkt.h"

namespace marble {

/// Solves with K = [Q + δI, Aᵀ; A, 0] by the factor of a Kkt that has a small −1/ρ in its corner. Repeated
/// steps on the residual of K itself remove the effect of ρ. Equalities may be dependent.
class ProximalSystem {
 public:
  ProximalSystem(const ScaledProblem& problem, Kkt& kkt);

  [[nodiscard]] bool factor(double rho, double delta);
  [[nodiscard]] Kkt& kkt() { return kkt_; }
  /// Replaces the right-hand side (x, y) by the solution. Returns false if interrupted.
  [[nodiscard]] bool solve(VectorRef x, VectorRef y);
  /// Moves (z, y) to the minimum of the Lagrangian for these multipliers of the rows, including ½δ|Δz|².
  /// Returns false if interrupted.
  [[nodiscard]] bool minimize(ConstVectorRef multipliers, Vector& z, Vector& y);

 private:
  const ScaledProblem& problem_;
  Kkt& kkt_;
  RowWeights weights_;
  Vector x_, y_, rest_x_, rest_y_, image_, right_x_, right_y_;
};

/// The columns that the engines of a tree share. Each engine fills them with its own system, which gives the
/// same bits.
class Gram {
 public:
  explicit Gram(const ScaledProblem& problem) : problem_(problem), columns_(problem.layout.size()) {}

  /// Returns the memory if every column is needed.
  [[nodiscard]] static double most_bytes(const ScaledProblem& problem) {
    const double rows = problem.layout.size();
    return rows * rows * sizeof(double);
  }

  /// Returns the memory of the existing columns.
  [[nodiscard]] double bytes();
  /// Returns a column, or null if it does not exist yet.
  [[nodiscard]] const double* find(Index row);
  /// Computes a column. Returns null if interrupted.
  [[nodiscard]] const double* fill(Index row, ProximalSystem& system);

 private:
  const ScaledProblem& problem_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<double[]>> columns_;
};

/// One engine's access to the columns, which takes the lock once per column.
class GramColumns {
 public:
  GramColumns(const ScaledProblem& problem, Gram& gram, ProximalSystem& system)
      : gram_(gram), system_(system), known_(problem.layout.size(), nullptr) {}

  [[nodiscard]] const double* operator()(Index row) {
    if (known_[row] == nullptr) look(row);
    return known_[row];
  }
  [[nodiscard]] Index size() const { return static_cast<Index>(known_.size()); }

 private:
  void look(Index row) {
    const double* column = gram_.find(row);
    if (column == nullptr) column = gram_.fill(row, system_);
    known_[row] = column;
  }

  Gram& gram_;
  ProximalSystem& system_;
  std::vector<const double*> known_;
};

}  // namespace marble
