// The KKT system (13) written out in full with dense matrices: what the condensed solver is held against.
#pragma once

#include <Eigen/Dense>

#include "residual.h"
#include "retraction.h"

namespace marble::testing {

inline Eigen::MatrixXd dense(const RowMatrix& m) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(m.rows, m.columns);
  for (Index row = 0; row < m.rows; ++row) {
    for (Index k = m.row_pointers[row]; k < m.row_pointers[row + 1]; ++k)
      out(row, m.column_indices[k]) = m.values[k];
  }
  return out;
}

inline Eigen::MatrixXd dense(const SymmetricMatrix& m) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(m.size, m.size);
  for (Index column = 0; column < m.size; ++column) {
    for (Index k = m.column_pointers[column]; k < m.column_pointers[column + 1]; ++k) {
      out(m.row_indices[k], column) = out(column, m.row_indices[k]) = m.values[k];
    }
  }
  return out;
}

/// Jacobian of the residual (13), rows and columns in the segments of Iterate, with δ on z and σ.
inline Eigen::MatrixXd full_jacobian(const ScaledProblem& p, const Subproblem& sub, const Iterate& x,
                                     double delta) {
  const Index n = p.variables(), n_c = p.pairs(), n_i = p.inequalities(), n_e = p.equalities();
  const Index sigma = n, v = sigma + n_c, y = v + n_i, w = y + n_e, left = w + n_i, right = left + n_c;
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(right + n_c, right + n_c);
  J.topLeftCorner(n, n) = dense(p.Q) + delta * Eigen::MatrixXd::Identity(n, n);
  const auto couple = [&](const RowMatrix& m, Index at) {
    J.block(at, 0, m.rows, n) = dense(m);
    J.block(0, at, n, m.rows) = dense(m).transpose();
    J.block(at, at, m.rows, m.rows).diagonal().setConstant(-1.0 / sub.rho);
  };
  couple(p.A, y);
  couple(p.C, w);
  couple(p.L, left);
  couple(p.R, right);
  for (Index i = 0; i < n_i; ++i) {
    const Retraction r(x.v()[i], sub.kappa);
    J(v + i, v + i) = -r.negative_slope();
    J(v + i, w + i) = 1.0;
    J(w + i, v + i) = -r.slope();
  }
  for (Index i = 0; i < n_c; ++i) {
    const Retraction h(x.sigma()[i], sub.kappa);
    J(sigma + i, sigma + i) = -h.curvature() * (x.lambda_L()[i] + x.lambda_R()[i]) + delta;
    J(sigma + i, left + i) = J(left + i, sigma + i) = -h.slope();
    J(sigma + i, right + i) = J(right + i, sigma + i) = h.negative_slope();
  }
  return J;
}

}  // namespace marble::testing
