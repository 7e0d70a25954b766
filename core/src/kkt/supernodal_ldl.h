// LDLᵀ for factors with much fill-in: columns with nearly the same rows form a dense block, and BLAS
// subtracts the products of blocks. Left-looking (Ng and Peyton, "Block sparse Cholesky algorithms on
// advanced uniprocessor computers", 1993).
#pragma once

#include <cstdint>
#include <vector>

#include "kkt/elimination.h"
#include "model/large_array.h"

namespace marble {

/// Factorizes a matrix in postorder. Long operations end early with false if they are interrupted.
class SupernodalLdl {
 public:
  /// Groups the columns. Numeric data exist only after allocate().
  explicit SupernodalLdl(const Elimination& elimination);
  [[nodiscard]] double count() const { return static_cast<double>(blocks_.size()); }
  /// Returns the memory of factor and workspace, without that of the analysis.
  [[nodiscard]] double bytes(const Pattern& matrix) const;
  [[nodiscard]] bool allocate(const Pattern& matrix, const Interrupt& interrupt);

  /// Takes values in the order of the matrix. Also returns false at a pivot that is 0.
  [[nodiscard]] bool factorize(const std::vector<double>& matrix_values, std::vector<double>& pivots,
                               const Interrupt& interrupt);
  /// Solves in place for a right-hand side that is 0 before `first`.
  [[nodiscard]] bool solve(double* x, Index first, const std::vector<double>& inverse_pivots,
                           const Interrupt& interrupt) const;
  /// The same for several right-hand sides: number k of row i is at x[i · count + k].
  [[nodiscard]] bool solve_many(double* x, int count, const std::vector<double>& inverse_pivots,
                                const Interrupt& interrupt) const;

 private:
  // Columns first … first + columns − 1 of L, all with the same rows: their own and those below.
  struct Block {
    Index first, columns, rows;
    Index group;                    // columns that share a list of rows; blocks are parts of a group
    std::int64_t row_list, values;  // start positions in rows_ and values_; the block is stored by columns
    [[nodiscard]] Index end() const { return first + columns; }
    [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(rows) * columns; }
  };
  struct Group {
    Index first, last;
    double zeros;  // explicit zeros: entries of the block that are not entries of the factor
  };
  void group_columns(const Elimination& elimination);
  void cut_into_blocks(const Elimination& elimination);
  [[nodiscard]] bool find_rows(const Pattern& matrix, Checkpoint& checkpoint);
  [[nodiscard]] std::int64_t place_of(Index row, Index column) const;
  [[nodiscard]] bool load(const std::vector<double>& matrix_values, const Interrupt& interrupt);
  void wait(Index source);
  void update(const Block& source, const Block& target, const double* pivots);
  [[nodiscard]] bool eliminate(const Block& block, double* pivots);

  std::vector<Group> groups_;
  std::vector<Index> group_parent_;  // group of the column that follows its last column in the tree
  std::vector<Block> blocks_;
  std::vector<Index> block_of_;       // by column
  std::vector<Index> rows_;           // lists, one per group
  std::vector<std::int64_t> places_;  // positions in values_ of the matrix's entries
  LargeArray<double> values_;
  Index most_rows_ = 0;
  // During a factorization, each block waits in the list of the next block in which it has rows.
  std::vector<Index> first_waiting_, next_waiting_, rows_done_, row_in_target_;
  LargeArray<double> scaled_, product_;  // D Lᵀ of an update, and its product; in solves: rows
};

}  // namespace marble
