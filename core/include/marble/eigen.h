// Views of Eigen's matrices and vectors, without copies. No other header includes Eigen.
//
//   Eigen::SparseMatrix<double> A = …;  Eigen::VectorXd b = …;
//   problem.A = marble::view(A), problem.b = marble::view(b);
//   Eigen::Map<const Eigen::VectorXd> z = marble::map(answer->z);
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

#include "marble/problem.h"

namespace marble {

/// The sparse matrices that can be viewed: compressed columns, 32-bit indices.
using EigenSparse = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;

/// Views a matrix, which must outlive the view and be compressed (makeCompressed()). Problem::create refuses
/// the view of an uncompressed one.
[[nodiscard]] inline SparseMatrixView view(const EigenSparse& matrix) {
  if (matrix.rows() == 0) return {};
  const auto columns = static_cast<std::size_t>(matrix.cols());
  const std::size_t entries = matrix.isCompressed() ? static_cast<std::size_t>(matrix.nonZeros()) : 0;
  return {static_cast<Index>(matrix.rows()),
          static_cast<Index>(matrix.cols()),
          {matrix.outerIndexPtr(), matrix.isCompressed() ? columns + 1 : 0},
          {matrix.innerIndexPtr(), entries},
          {matrix.valuePtr(), entries}};
}
/// Deleted: a temporary would not outlive the view.
SparseMatrixView view(const EigenSparse&& matrix) = delete;

/// A vector with contiguous numbers: a VectorXd, a Map, a Ref, a segment; not an expression such as a + b.
template <class Vector>
concept EigenVector =
    bool(Vector::IsVectorAtCompileTime) && std::is_same_v<typename Vector::Scalar, double> &&
    (int(Vector::Flags) & int(Eigen::DirectAccessBit)) != 0 && int(Vector::InnerStrideAtCompileTime) == 1;

/// Views a vector, which must outlive the view.
template <EigenVector Vector>
[[nodiscard]] std::span<const double> view(const Eigen::MatrixBase<Vector>& vector) {
  return {vector.derived().data(), static_cast<std::size_t>(vector.size())};
}

/// Maps a solution's vector, which must outlive the map, for reading with Eigen.
[[nodiscard]] inline Eigen::Map<const Eigen::VectorXd> map(std::span<const double> values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}
/// As above.
[[nodiscard]] inline Eigen::Map<const Eigen::VectorXd> map(const std::vector<double>& values) {
  return map(std::span<const double>(values));
}

}  // namespace marble
