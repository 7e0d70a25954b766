// LDLᵀ of a symmetric matrix: ordered and analysed once, factorized in place for each set of values.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "kkt/elimination.h"
#include "kkt/lanes.h"
#include "kkt/supernodal_ldl.h"
#include "model/large_array.h"

namespace marble {

/// Long operations of this class end early with false if they are interrupted.
class SparseLdl {
 public:
  /// Orders the pattern and predicts the structure of the factor. Numeric data exist only after allocate().
  [[nodiscard]] bool analyse(const Pattern& pattern, const Interrupt& interrupt);
  /// Allocates the memory of the factor.
  [[nodiscard]] bool allocate(const Interrupt& interrupt);

  /// Returns the pattern of the permuted matrix: upper triangle, rows of a column in any order. Values are
  /// given in this order.
  [[nodiscard]] const Pattern& matrix() const { return matrix_; }
  /// Returns the position of each entry of the analysed pattern in matrix(), until forget_places().
  [[nodiscard]] const std::vector<Index>& places() const { return places_; }
  void forget_places() { places_ = {}; }
  /// Row i of the analysed pattern is row position()[i] of the permuted one.
  [[nodiscard]] const std::vector<Index>& position() const { return inverse_permutation_; }
  /// Returns the cost of one factorization, as the flops of the sparse code that would take the same time.
  [[nodiscard]] double flops() const;
  /// True if the factor fills in and is computed in blocks.
  [[nodiscard]] bool has_blocks() const { return blocks_.has_value(); }
  /// Returns the memory of factor and workspace, known before allocate().
  [[nodiscard]] double bytes() const;

  /// Also returns false at a pivot that is 0.
  [[nodiscard]] bool factorize(const std::vector<double>& values, const Interrupt& interrupt);
  [[nodiscard]] Index positive_pivots() const;
  /// Solves in place for a right-hand side that is 0 before `first`; for several at once with T = Lanes<2>,
  /// <4> or <8>.
  template <class T>
  [[nodiscard]] bool solve(T* x, Index first, const Interrupt& interrupt) const;

 private:
  [[nodiscard]] Index size() const { return matrix_.size(); }
  [[nodiscard]] std::int64_t entries_of(Index begin, Index end) const {
    return pointers_[end] - pointers_[begin];
  }
  void permute(const Pattern& pattern, const std::vector<Index>& permutation);
  [[nodiscard]] bool find_patterns(const Interrupt& interrupt);
  /// Position in a factorization: the current row, the next entry of its pattern, its pivot so far.
  struct Place {
    Index row = 0;
    std::int64_t at = 0;
    double pivot = 0.0;
  };
  [[nodiscard]] bool eliminate(const double* matrix_values, Place& place, std::int64_t last);

  Pattern matrix_;
  std::vector<Index> places_, inverse_permutation_;
  Elimination elimination_;
  std::optional<SupernodalLdl> blocks_;
  std::vector<std::int64_t> pointers_;  // of L by columns, without its diagonal
  std::vector<std::int64_t> row_pointers_;
  std::int64_t longest_ = 0;          // longest column of L
  LargeArray<Index> rows_, columns_;  // of L's entries, by columns and by rows
  LargeArray<double> values_;
  std::vector<double> pivots_, inverse_pivots_, dense_row_;
  std::vector<std::int64_t> next_;  // where each column of L continues
};

}  // namespace marble
