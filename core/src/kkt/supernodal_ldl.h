// LDLᵀ where a factor fills in: columns with nearly the same rows are one dense block, and BLAS takes blocks
// off each other. Left-looking (Ng and Peyton, "Block sparse Cholesky algorithms on advanced uniprocessor
// computers", 1993).
#pragma once

#include <cstdint>
#include <vector>

#include "data/large_array.h"
#include "kkt/elimination.h"

namespace marble {

/// Of a matrix in postorder. What takes long ends early, with false, where it is interrupted.
class SupernodalLdl {
 public:
  /// Groups the columns. Nothing numeric is there before allocate().
  explicit SupernodalLdl(const Elimination& elimination);
  [[nodiscard]] double count() const { return static_cast<double>(blocks_.size()); }
  /// Of factor and workspace, besides those of the analysis.
  [[nodiscard]] double bytes(const Pattern& matrix) const;
  [[nodiscard]] bool allocate(const Pattern& matrix, const Interrupt& interrupt);

  /// Values in the order of the matrix. Also false at a pivot that is 0.
  [[nodiscard]] bool factorize(const std::vector<double>& matrix_values, std::vector<double>& pivots,
                               const Interrupt& interrupt);
  /// Solves in place, for a right-hand side that is 0 before `first`.
  [[nodiscard]] bool solve(double* x, Index first, const std::vector<double>& inverse_pivots,
                           const Interrupt& interrupt) const;
  /// The same of several right-hand sides: number k of row i at x[i · count + k].
  [[nodiscard]] bool solve_many(double* x, int count, const std::vector<double>& inverse_pivots,
                                const Interrupt& interrupt) const;

 private:
  // Columns first … first + columns − 1 of L, all of them with the same rows: their own and those below.
  struct Block {
    Index first, columns, rows;
    Index group;                    // of columns that share a list of rows; blocks are parts of it
    std::int64_t row_list, values;  // where they begin in rows_ and values_; the block is by columns
    [[nodiscard]] Index end() const { return first + columns; }
    [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(rows) * columns; }
  };
  struct Group {
    Index first, last;
    double zeros;  // entries of its block that the factor has not got
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
  std::vector<Index> group_parent_;  // of the column that follows its last one in the tree
  std::vector<Block> blocks_;
  std::vector<Index> block_of_;       // column
  std::vector<Index> rows_;           // lists, one a group
  std::vector<std::int64_t> places_;  // in values_, of the matrix' entries
  LargeArray<double> values_;
  Index most_rows_ = 0;
  // While factorizing: each block waits for the next that it has rows in, in a list of that one's.
  std::vector<Index> first_waiting_, next_waiting_, rows_done_, row_in_target_;
  LargeArray<double> scaled_, product_;  // D Lᵀ of an update, and what it adds up to; of solves: rows
};

}  // namespace marble
