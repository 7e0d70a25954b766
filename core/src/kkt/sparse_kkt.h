// Sparse backend: LDLᵀ of the system, with a pattern that is analysed once.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "kkt/kkt.h"
#include "kkt/sparse_ldl.h"

namespace marble {

/// Which constraint rows become rows of the system instead of rank-one terms of H.
enum class KeptRows {
  none,   ///< condense everything into (x, y)
  dense,  ///< keep rows that are long enough to fill H by themselves
  all,    ///< the full system: most rows, least fill-in in each
};

class SparseKkt final : public Kkt {
 public:
  /// Orders and analyses the pattern. Numeric data exist only after allocate(). Returns null if interrupted.
  [[nodiscard]] static std::unique_ptr<SparseKkt> analyse(const ScaledProblem& problem, KeptRows kept,
                                                          const Interrupt& interrupt = {});
  /// Returns the memory of the analysis itself, computed without running it.
  [[nodiscard]] static double analysis_bytes(const ScaledProblem& problem, KeptRows kept);
  /// True if a row with this many entries fills H by itself.
  [[nodiscard]] static bool is_long_row(Index length, Index variables);

  [[nodiscard]] bool allocate(const ScaledProblem& problem) override;
  void load(const ScaledProblem& problem) override;
  [[nodiscard]] bool solve(VectorRef x, VectorRef y) override;
  [[nodiscard]] bool solve_many(double* x, double* y, int count) override;
  [[nodiscard]] bool solve_sparse(std::span<const Index> indices, std::span<const double> values,
                                  VectorRef x) override;
  [[nodiscard]] std::string_view name() const override;
  [[nodiscard]] double flops() const override { return flops_; }
  [[nodiscard]] double bytes() const override;

 private:
  template <class T>
  [[nodiscard]] bool solve_lanes(T* x, T* y, T* work);
  [[nodiscard]] bool refine();
  [[nodiscard]] bool factorize(const RowWeights& weights) override;
  // A constraint's columns, its values (two rows for a pair), and the places of its terms in the factorized
  // matrix.
  struct Row {
    bool kept = false;
    std::vector<Index> columns;
    std::vector<double> values,
        second_values;                // L_i and R_i of a pair; second_values is empty for inequalities
    std::vector<Index> slots;         // condensed: lower triangle of the outer product; kept: one per column
    std::vector<Index> second_slots;  // kept pair: those of its second row
    Index diagonal = -1, second_diagonal = -1;  // kept: slots of −1/k
  };

  SparseKkt(const ScaledProblem& problem, KeptRows kept);
  void gather_rows(const ScaledProblem& problem, KeptRows kept);
  [[nodiscard]] bool build_pattern(const ScaledProblem& problem);
  [[nodiscard]] double estimated_flops() const;
  void assemble(const RowWeights& weights);
  void add_condensed(const Row& row, double left_left, double left_right, double right_right);
  [[nodiscard]] Index kept_negative_weights(const RowWeights& weights) const;

  KeptRows kept_;
  Index variables_, equalities_, size_ = 0;
  std::vector<Row> inequality_rows_, pair_rows_;
  double flops_ = 0.0;
  SparseLdl ldl_;
  std::vector<double> constant_, values_;  // of the permuted matrix: the constant part, and all
  std::vector<Index> constant_slots_;      // of the entries of Q and A, in their order
  std::vector<Index> diagonal_slots_;      // of x and y
  Vector right_side_, solution_, residual_;
  Vector many_;  // workspace of solve_many()
};

}  // namespace marble
