#include "composite/dense.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Householder>
#include <Eigen/Jacobi>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "model/tuning.h"

namespace marble {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Size = Eigen::Index;

// A ← QᵀAQ, tridiagonal; the reflectors are kept below the subdiagonal.
bool reduce(MatrixXd& a, VectorXd& diagonal, VectorXd& subdiagonal, VectorXd& scales,
            Checkpoint& checkpoint) {
  const Size n = a.rows();
  VectorXd product(n);
  for (Size i = 0; i + 1 < n; ++i) {
    const Size rest = n - i - 1;
    auto v = a.col(i).tail(rest);
    double scale = 0.0, beta = 0.0;
    v.makeHouseholderInPlace(scale, beta);
    v[0] = 1.0;
    auto corner = a.bottomRightCorner(rest, rest);
    auto p = product.head(rest);
    p.noalias() = corner.selfadjointView<Eigen::Lower>() * (scale * v);
    p += (-0.5 * scale * p.dot(v)) * v;
    corner.selfadjointView<Eigen::Lower>().rankUpdate(v, p, -1.0);
    scales[i] = scale, subdiagonal[i] = beta;
    if (checkpoint.reached(2 * rest * rest)) return false;
  }
  diagonal = a.diagonal();
  return true;
}

// A ← Q, the product of the reflectors stored in it.
bool accumulate(MatrixXd& a, const VectorXd& scales, Checkpoint& checkpoint) {
  const Size n = a.rows();
  VectorXd v(n);
  Eigen::RowVectorXd product(n);
  for (Size i = n - 2; i >= 0; --i) {
    const Size rest = n - i - 1;
    v.head(rest) = a.col(i).tail(rest);
    v[0] = 1.0;
    if (i == n - 2) a(n - 1, n - 1) = 1.0;
    // Row and column i + 1 are still those of the identity.
    auto corner = a.bottomRightCorner(rest, rest);
    if (i < n - 2) {
      corner.col(0).setZero(), corner.row(0).setZero();
      corner(0, 0) = 1.0;
    }
    auto p = product.head(rest);
    p.noalias() = v.head(rest).transpose() * corner;
    corner.noalias() -= (scales[i] * v.head(rest)) * p;
    if (checkpoint.reached(2 * rest * rest)) return false;
  }
  if (n > 1) a.col(0).setZero(), a.row(0).setZero();
  a(0, 0) = 1.0;
  return true;
}

// One implicit QR step with Wilkinson's shift on [first, last].
void step(VectorXd& diagonal, VectorXd& subdiagonal, Size first, Size last, MatrixXd& vectors) {
  const double half = 0.5 * (diagonal[last - 1] - diagonal[last]), e = subdiagonal[last - 1];
  double shift = diagonal[last];
  if (half == 0.0) {
    shift -= std::abs(e);
  } else if (e != 0.0) {
    const double root = std::hypot(half, e);
    shift -= e / ((half + (half > 0.0 ? root : -root)) / e);
  }
  double x = diagonal[first] - shift, z = subdiagonal[first];
  for (Size k = first; k < last && z != 0.0; ++k) {
    Eigen::JacobiRotation<double> turn;
    turn.makeGivens(x, z);
    const double c = turn.c(), s = turn.s();
    const double below = s * diagonal[k] + c * subdiagonal[k];
    const double corner = s * subdiagonal[k] + c * diagonal[k + 1];
    diagonal[k] = c * (c * diagonal[k] - s * subdiagonal[k]) - s * (c * subdiagonal[k] - s * diagonal[k + 1]);
    diagonal[k + 1] = s * below + c * corner;
    subdiagonal[k] = c * below - s * corner;
    if (k > first) subdiagonal[k - 1] = c * subdiagonal[k - 1] - s * z;
    x = subdiagonal[k];
    if (k + 1 < last) {
      z = -s * subdiagonal[k + 1];
      subdiagonal[k + 1] *= c;
    }
    vectors.applyOnTheRight(k, k + 1, turn);
  }
}

bool iterate(VectorXd& diagonal, VectorXd& subdiagonal, MatrixXd& vectors, Checkpoint& checkpoint) {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  const Size n = diagonal.size();
  Size last = n - 1;
  for (Size steps = 0; last > 0; ++steps) {
    for (Size i = 0; i < last; ++i) {
      const double scaled = subdiagonal[i] / kEpsilon;
      if (std::abs(subdiagonal[i]) < std::numeric_limits<double>::min() ||
          scaled * scaled <= std::abs(diagonal[i]) + std::abs(diagonal[i + 1]))
        subdiagonal[i] = 0.0;
    }
    while (last > 0 && subdiagonal[last - 1] == 0.0) --last;
    if (last == 0) break;
    if (steps >= Eigen::SelfAdjointEigenSolver<MatrixXd>::m_maxIterations * n) return false;
    Size first = last - 1;
    while (first > 0 && subdiagonal[first - 1] != 0.0) --first;
    step(diagonal, subdiagonal, first, last, vectors);
    if (checkpoint.reached(2 * n * (last - first))) return false;
  }
  return true;
}

}  // namespace

bool eigen_decomposition(MatrixXd& a, VectorXd& values, const Interrupt& interrupt) {
  const Size n = a.rows();
  Checkpoint checkpoint(interrupt);
  values.resize(n);
  double scale = 0.0;  // entries in [-1, 1] neither overflow nor underflow
  for (Size j = 0; j < n; ++j) scale = std::max(scale, a.col(j).tail(n - j).cwiseAbs().maxCoeff());
  if (scale == 0.0) scale = 1.0;
  if (!std::isfinite(scale)) return false;
  a /= scale;
  VectorXd subdiagonal(n), scales(n);
  if (!reduce(a, values, subdiagonal, scales, checkpoint) || !accumulate(a, scales, checkpoint) ||
      !iterate(values, subdiagonal, a, checkpoint))
    return false;
  values *= scale;
  return true;
}

bool spectral_product(const MatrixXd& vectors, const VectorXd& values, Eigen::Ref<MatrixXd> out,
                      const Interrupt& interrupt) {
  const Size n = vectors.rows();
  const double flops = 2.0 * static_cast<double>(n) * static_cast<double>(n);
  const auto width = static_cast<Size>(std::max(1.0, tuning::flops_of_call / flops));
  for (Size column = 0; column < n; column += width) {
    if (column > 0 && interrupt.requested()) return false;
    const Size columns = std::min(width, n - column);
    out.middleCols(column, columns).noalias() =
        vectors * (values.asDiagonal() * vectors.middleRows(column, columns).transpose());
  }
  return true;
}

bool solve_semidefinite(MatrixXd& a, VectorXd& x, const Interrupt& interrupt) {
  const Size n = a.rows();
  Checkpoint checkpoint(interrupt);
  std::vector<Size> swapped(static_cast<std::size_t>(n));
  VectorXd weighted(n);
  for (Size k = 0; k < n; ++k) {
    Size pivot = 0;
    a.diagonal().tail(n - k).cwiseAbs().maxCoeff(&pivot);
    pivot += k;
    swapped[static_cast<std::size_t>(k)] = pivot;
    if (pivot != k) {  // swaps in the lower triangle only
      const Size below = n - pivot - 1;
      a.row(k).head(k).swap(a.row(pivot).head(k));
      a.col(k).tail(below).swap(a.col(pivot).tail(below));
      std::swap(a(k, k), a(pivot, pivot));
      for (Size i = k + 1; i < pivot; ++i) std::swap(a(i, k), a(pivot, i));
    }
    const Size rest = n - k - 1;
    if (k > 0) {
      weighted.head(k) = a.diagonal().head(k).cwiseProduct(a.row(k).head(k).transpose());
      a(k, k) -= a.row(k).head(k) * weighted.head(k);
      if (rest > 0) a.col(k).tail(rest).noalias() -= a.block(k + 1, 0, rest, k) * weighted.head(k);
    }
    if (rest > 0 && std::abs(a(k, k)) > 0.0) a.col(k).tail(rest) /= a(k, k);
    if (checkpoint.reached(rest * (k + 1))) return false;
  }
  for (Size k = 0; k < n; ++k) std::swap(x[k], x[swapped[static_cast<std::size_t>(k)]]);
  a.triangularView<Eigen::UnitLower>().solveInPlace(x);
  for (Size k = 0; k < n; ++k)
    x[k] = std::abs(a(k, k)) > std::numeric_limits<double>::min() ? x[k] / a(k, k) : 0.0;
  a.transpose().triangularView<Eigen::UnitUpper>().solveInPlace(x);
  for (Size k = n - 1; k >= 0; --k) std::swap(x[k], x[swapped[static_cast<std::size_t>(k)]]);
  return true;
}

}  // namespace marble
