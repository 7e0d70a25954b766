// The problem that Marble solves, as validated views that borrow the caller's arrays.
//
//   min ½ zᵀQz + gᵀz + c₀   s.t.   A z + b = 0,   C z + d ≥ 0,   0 ≤ L z + l  ⊥  R z + r ≥ 0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "marble/error.h"

namespace marble {

/// Row and column numbers. 32 bits: no LCQP that fits a solver's memory needs more.
using Index = std::int32_t;

/// Where rows have limits lb ≤ row ≤ ub, a limit of this size or more means that there is none. Rows of C are
/// never interpreted that way: a row with d = 1e20 always holds, and costs as much as any other.
inline constexpr double infinite_limit = 1e20;

/// A sparse matrix in compressed column form; borrows its arrays. Row indices ascend strictly within a
/// column. An empty matrix has no rows, no columns and empty spans; any other must be complete.
struct SparseMatrixView {
  Index rows = 0;                          ///< >= 0
  Index columns = 0;                       ///< n; 0 for an empty matrix
  std::span<const Index> column_pointers;  ///< columns + 1 entries, from 0 to the number of entries
  std::span<const Index> row_indices;      ///< one per entry, in [0, rows)
  std::span<const double> values;          ///< one per entry, finite

  /// Returns the number of stored entries.
  [[nodiscard]] Index entries() const { return static_cast<Index>(values.size()); }
};

/// How the symmetric matrix Q is given.
enum class HessianForm {
  full,            ///< both triangles, equal up to rounding; the solver uses the upper one
  upper_triangle,  ///< only entries with row ≤ column; the mirror image is implied
};

/// The unchecked parts of a problem. Every span must outlive the `Problem` made from it. A matrix without
/// rows may be left default-constructed.
struct ProblemView {
  SparseMatrixView Q;  ///< n × n, symmetric; may be indefinite (the solution is then local: see SecondOrder)
  HessianForm hessian_form = HessianForm::full;  ///< whether Q has both triangles
  std::span<const double> g;                     ///< n, linear cost; its size defines n
  double c0 = 0.0;                               ///< constant cost
  SparseMatrixView A;                            ///< n_e × n
  std::span<const double> b;                     ///< n_e
  SparseMatrixView C;                            ///< n_i × n
  std::span<const double> d;                     ///< n_i
  SparseMatrixView L;                            ///< n_c × n
  std::span<const double> l;                     ///< n_c
  SparseMatrixView R;                            ///< n_c × n
  std::span<const double> r;                     ///< n_c
};

/// A validated problem: shapes agree, indices are in range and sorted, numbers are finite, Q is symmetric. It
/// still borrows the caller's arrays. Inner code checks nothing again.
class Problem {
 public:
  /// Checks everything. The error names the first problem found: field, index, value and the bound it
  /// violates.
  [[nodiscard]] static Expected<Problem> create(const ProblemView& view);

  /// Checks that `z` can be a starting point: empty, or n finite numbers. The error's field is "initial_z".
  [[nodiscard]] static Expected<void> check_initial_point(std::span<const double> z, Index variables);

  /// Returns the parts that the problem was made from.
  [[nodiscard]] const ProblemView& view() const { return view_; }
  /// n
  [[nodiscard]] Index variables() const { return static_cast<Index>(view_.g.size()); }
  /// n_e
  [[nodiscard]] Index equalities() const { return static_cast<Index>(view_.b.size()); }
  /// n_i
  [[nodiscard]] Index inequalities() const { return static_cast<Index>(view_.d.size()); }
  /// n_c
  [[nodiscard]] Index pairs() const { return static_cast<Index>(view_.l.size()); }

 private:
  explicit Problem(const ProblemView& view) : view_(view) {}
  ProblemView view_;
};

/// Checks that `values` are `size` finite numbers; the error's field is `field`.
[[nodiscard]] Expected<void> check_numbers(std::span<const double> values, std::size_t size,
                                           const char* field);

/// New numbers for a problem with the same sizes and sparsity patterns. Absent parts keep their numbers.
struct ProblemUpdate {
  std::optional<double> c0 = {};   ///< constant cost
  std::span<const double> g = {};  ///< n
  std::span<const double> b = {};  ///< n_e
  std::span<const double> d = {};  ///< n_i
  std::span<const double> l = {};  ///< n_c
  std::span<const double> r = {};  ///< n_c
  std::span<const double> Q = {};  ///< values of all entries in their order; of a full Q, upper ones are used
  std::span<const double> A = {};  ///< values of all entries in their order
  std::span<const double> C = {};  ///< values of all entries in their order
  std::span<const double> L = {};  ///< values of all entries in their order
  std::span<const double> R = {};  ///< values of all entries in their order
};

/// The number of values in each part of a problem, which an update must match.
struct PartSizes {
  /// Returns the sizes of a problem.
  [[nodiscard]] static PartSizes of(const Problem& problem);

  /// Checks that every part present in the update has the right size and is finite. The error's field is that
  /// of the part: "g", "A.values".
  [[nodiscard]] Expected<void> check(const ProblemUpdate& update) const;
  /// True if an update for one also fits the other.
  friend bool operator==(const PartSizes&, const PartSizes&) = default;

  std::size_t g = 0;  ///< n
  std::size_t b = 0;  ///< n_e
  std::size_t d = 0;  ///< n_i
  std::size_t l = 0;  ///< n_c
  std::size_t r = 0;  ///< n_c
  std::size_t Q = 0;  ///< stored entries
  std::size_t A = 0;  ///< stored entries
  std::size_t C = 0;  ///< stored entries
  std::size_t L = 0;  ///< stored entries
  std::size_t R = 0;  ///< stored entries
};

/// A sparse matrix that owns its arrays.
struct SparseMatrix {
  Index rows = 0;                      ///< as in SparseMatrixView, like all members below
  Index columns = 0;                   ///< n, except for an absent matrix
  std::vector<Index> column_pointers;  ///< columns + 1
  std::vector<Index> row_indices;      ///< one per entry
  std::vector<double> values;          ///< one per entry

  /// Returns a view of the arrays, which must outlive it.
  [[nodiscard]] SparseMatrixView view() const {
    return {rows, columns, column_pointers, row_indices, values};
  }
};

/// Entries in any order; compress() adds up duplicates.
struct Triplets {
  std::vector<Index> rows;     ///< one per entry, from 0
  std::vector<Index> columns;  ///< one per entry, from 0
  std::vector<double> values;  ///< one per entry

  /// Appends an entry.
  void add(Index row, Index column, double value) {
    rows.push_back(row);
    columns.push_back(column);
    values.push_back(value);
  }
};

/// Sorts triplets into compressed columns in O(entries log entries). Errors use `name`: "<name>.i",
/// "<name>.j", "<name>.v", with the position among the triplets. Sums of duplicates must be finite too.
[[nodiscard]] Expected<SparseMatrix> compress(Index rows, Index columns, const Triplets& entries,
                                              const char* name);

/// A problem that owns its arrays, as readers and generators produce it.
struct OwnedProblem {
  std::string name;                              ///< for display; may be empty
  SparseMatrix Q;                                ///< n × n, symmetric
  SparseMatrix A;                                ///< n_e × n
  SparseMatrix C;                                ///< n_i × n
  SparseMatrix L;                                ///< n_c × n
  SparseMatrix R;                                ///< n_c × n
  HessianForm hessian_form = HessianForm::full;  ///< whether Q has both triangles
  std::vector<double> g;                         ///< n; its size defines n
  std::vector<double> b;                         ///< n_e
  std::vector<double> d;                         ///< n_i
  std::vector<double> l;                         ///< n_c
  std::vector<double> r;                         ///< n_c
  double c0 = 0.0;                               ///< constant cost
  std::vector<double> initial_z;                 ///< n or empty: the starting point of a solve

  /// Returns a view of the arrays, which must outlive it.
  [[nodiscard]] ProblemView view() const {
    return {Q.view(), hessian_form, g, c0, A.view(), b, C.view(), d, L.view(), l, R.view(), r};
  }
};

}  // namespace marble
