// LDLᵀ of a symmetric matrix: ordered and analysed once, factorized in place as often as its values change.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "data/large_array.h"
#include "kkt/elimination.h"
#include "kkt/supernodal_ldl.h"
#include "lanes/lanes.h"

namespace marble {

/// Whatever takes long here ends early, with false, where it is interrupted.
class SparseLdl {
 public:
  /// Orders the pattern and finds what its factor will look like. Nothing numeric is there before allocate().
  [[nodiscard]] bool analyse(const Pattern& pattern, const Interrupt& interrupt);
  /// Takes the memory of the factor.
  [[nodiscard]] bool allocate(const Interrupt& interrupt);

  /// The permuted matrix, upper triangle, rows in no order within a column: values are given in its order.
  [[nodiscard]] const Pattern& matrix() const { return matrix_; }
  /// Where each entry of the analysed pattern is in it, until they are forgotten.
  [[nodiscard]] const std::vector<Index>& places() const { return places_; }
  void forget_places() { places_ = {}; }
  /// Row i of the analysed pattern is row position()[i] of the permuted one.
  [[nodiscard]] const std::vector<Index>& position() const { return inverse_permutation_; }
  /// Of one factorization, in units of what takes the sparse code as long.
  [[nodiscard]] double flops() const;
  /// Whether the factor fills in, and is computed in blocks.
  [[nodiscard]] bool has_blocks() const { return blocks_.has_value(); }
  /// Of factor and workspace, known before allocate().
  [[nodiscard]] double bytes() const;

  /// Also false at a pivot that is 0.
  [[nodiscard]] bool factorize(const std::vector<double>& values, const Interrupt& interrupt);
  [[nodiscard]] Index positive_pivots() const;
  /// Solves in place, for a right-hand side that is 0 before `first`; for several, with T = Lanes<2>, <4> or
  /// <8>.
  template <class T>
  [[nodiscard]] bool solve(T* x, Index first, const Interrupt& interrupt) const;

 private:
  [[nodiscard]] Index size() const { return matrix_.size(); }
  [[nodiscard]] std::int64_t entries_of(Index begin, Index end) const {
    return pointers_[end] - pointers_[begin];
  }
  void permute(const Pattern& pattern, const std::vector<Index>& permutation);
  [[nodiscard]] bool find_patterns(const Interrupt& interrupt);
  /// Where a factorization is: the row at hand, the next entry of its pattern, its pivot so far.
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
  std::int64_t longest_ = 0;          // column of L
  LargeArray<Index> rows_, columns_;  // of L's entries, by columns and by rows
  LargeArray<double> values_;
  std::vector<double> pivots_, inverse_pivots_, dense_row_;
  std::vector<std::int64_t> next_;  // where each column of L goes on
};

}  // namespace marble
