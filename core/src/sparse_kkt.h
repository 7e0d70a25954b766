// Sparse backend: LDLᵀ of the AMD-ordered system; SuiteSparse's LDL and AMD analyse it once, the numeric
// factor is found in place.
#pragma once

#include <string_view>
#include <vector>

#include "kkt.h"

namespace marble {

/// Which constraint rows become rows of the system instead of rank-one terms of H.
enum class KeptRows {
  none,   ///< condense everything into (x, y)
  dense,  ///< keep rows long enough to fill H by themselves
  all,    ///< the full system: most rows, least fill in each
};

class SparseKkt final : public Kkt {
 public:
  /// Orders and analyses the pattern. Nothing numeric is there before allocate().
  SparseKkt(const ScaledProblem& problem, KeptRows kept);
  /// Memory that the analysis itself takes, before there is anything to look at.
  [[nodiscard]] static double analysis_bytes(const ScaledProblem& problem, KeptRows kept);

  void allocate(const ScaledProblem& problem) override;
  void load(const ScaledProblem& problem) override;
  [[nodiscard]] bool factor(const RowWeights& weights) override;
  void solve(VectorRef x, VectorRef y) override;
  void solve_sparse(std::span<const Index> indices, std::span<const double> values, VectorRef x) override;
  [[nodiscard]] std::string_view name() const override;
  [[nodiscard]] double flops() const override { return flops_; }
  [[nodiscard]] double bytes() const override;

 private:
  // A constraint's columns, its values (two rows for a pair), and where its terms go in the factorized
  // matrix.
  struct Row {
    bool kept = false;
    std::vector<Index> columns;
    std::vector<double> values,
        second_values;                // L_i and R_i of a pair; second_values is empty for inequalities
    std::vector<Index> slots;         // condensed: lower triangle of the outer product; kept: one per column
    std::vector<Index> second_slots;  // kept pair: of its second row
    Index diagonal = -1, second_diagonal = -1;  // kept: slots of −1/k
  };

  void gather_rows(const ScaledProblem& problem, KeptRows kept);
  void build_pattern(const ScaledProblem& problem);
  void order_and_analyse(const std::vector<Index>& columns, const std::vector<Index>& rows);
  void assemble(const RowWeights& weights);
  void add_condensed(const Row& row, double left_left, double left_right, double right_right);
  void find_row_patterns();
  [[nodiscard]] bool factorize();
  void back_substitute(double* out, Index first) const;
  [[nodiscard]] Index kept_negative_weights(const RowWeights& weights) const;

  KeptRows kept_;
  Index variables_, equalities_, size_ = 0;
  std::vector<Row> inequality_rows_, pair_rows_;
  double flops_ = 0.0;

  // Upper triangle of the permuted matrix, by columns.
  std::vector<Index> column_pointers_, row_indices_;
  std::vector<double> constant_, values_;
  std::vector<Index> constant_slots_;  // of the entries of Q and A, in their order
  std::vector<Index> diagonal_slots_;  // of x and y
  std::vector<Index> permutation_, inverse_permutation_;

  // LDL: factor and workspace.
  std::vector<Index> factor_pointers_, parent_, factor_counts_, factor_rows_, flag_, next_;
  std::vector<Index> row_pattern_pointers_, row_patterns_;  // of L by rows
  std::vector<double> factor_values_, pivots_, inverse_pivots_, dense_row_;
  Vector right_side_, solution_, residual_;
};

}  // namespace marble
