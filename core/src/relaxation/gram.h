// The convex relaxations of all nodes seen from their rows: G = J K⁻¹ Jᵀ, what a unit multiplier of one row
// does to the slacks of all. K, the root's system with Q, the equalities and the proximal term, is the same
// for every node, so that a column is solved for once a tree, when its row first becomes active.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "kkt/kkt.h"

namespace marble {

/// K = [Q + δI, Aᵀ; A, 0] by the factor of a Kkt that has a small −1/ρ in its corner: repeated on the
/// residual of K itself, which leaves no trace of ρ. Dependent equalities do no harm.
class ProximalSystem {
 public:
  ProximalSystem(const ScaledProblem& problem, Kkt& kkt);

  [[nodiscard]] bool factor(double rho, double delta);
  [[nodiscard]] Kkt& kkt() { return kkt_; }
  /// For (x, y) in place of the right-hand side. False if interrupted.
  [[nodiscard]] bool solve(VectorRef x, VectorRef y);
  /// Moves (z, y) to the minimum of the Lagrangian for these multipliers of the rows, ½δ|Δz|² included. False
  /// if interrupted.
  [[nodiscard]] bool minimize(ConstVectorRef multipliers, Vector& z, Vector& y);

 private:
  const ScaledProblem& problem_;
  Kkt& kkt_;
  RowWeights weights_;
  Vector x_, y_, rest_x_, rest_y_, image_, right_x_, right_y_;
};

/// What the engines of a tree share; each fills it by its own system, which makes the same bits.
class Gram {
 public:
  explicit Gram(const ScaledProblem& problem) : problem_(problem), columns_(problem.layout.size()) {}

  /// Memory if every column is needed.
  [[nodiscard]] static double most_bytes(const ScaledProblem& problem) {
    const double rows = problem.layout.size();
    return rows * rows * sizeof(double);
  }

  /// Memory of those there are.
  [[nodiscard]] double bytes();
  /// Null where it is not there yet.
  [[nodiscard]] const double* find(Index row);
  /// Solves for it. Null if that is interrupted.
  [[nodiscard]] const double* fill(Index row, ProximalSystem& system);

 private:
  const ScaledProblem& problem_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<double[]>> columns_;
};

/// One engine's way to it, which asks for a lock once a column.
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
