#include "dense_system.h"

#include <Eigen/Dense>
#include <cmath>

#include "row_parts.h"

namespace marble::testing {

Eigen::MatrixXd dense(const RowMatrix& m) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(m.rows, m.columns);
  for (Index row = 0; row < m.rows; ++row) {
    for (Index k = m.row_pointers[row]; k < m.row_pointers[row + 1]; ++k)
      out(row, m.column_indices[k]) = m.values[k];
  }
  return out;
}

Eigen::MatrixXd dense(const SymmetricMatrix& m) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(m.size, m.size);
  for (Index column = 0; column < m.size; ++column) {
    for (Index k = m.column_pointers[column]; k < m.column_pointers[column + 1]; ++k) {
      out(m.row_indices[k], column) = out(column, m.row_indices[k]) = m.values[k];
    }
  }
  return out;
}

double p(double sigma, double kappa) { return 0.5 * (sigma + std::sqrt(sigma * sigma + 4.0 * kappa)); }
double p_slope(double sigma, double kappa) {
  return 0.5 * (1.0 + sigma / std::sqrt(sigma * sigma + 4.0 * kappa));
}
double p_curvature(double sigma, double kappa) {
  return 2.0 * kappa / std::pow(sigma * sigma + 4.0 * kappa, 1.5);
}

namespace {

// Of the sides of a pair, s = h(σ) and t = h(−σ): h and its derivatives by the retraction chosen.
using Function = double (*)(double, double);
double exponential(double sigma, double kappa) { return std::sqrt(kappa) * std::exp(sigma); }
Function side(const Subproblem& sub) { return sub.retraction == Retraction::softplus ? p : exponential; }
Function side_slope(const Subproblem& sub) {
  return sub.retraction == Retraction::softplus ? p_slope : exponential;
}
Function side_curvature(const Subproblem& sub) {
  return sub.retraction == Retraction::softplus ? p_curvature : exponential;
}

}  // namespace

Vector literal_residual(const ScaledProblem& problem, const Subproblem& sub, const Iterate& x) {
  const Eigen::MatrixXd A = dense(problem.A), C = dense(C_of(problem)), L = dense(L_of(problem)),
                        R = dense(R_of(problem));
  const auto every = [&sub](const auto& values, double sign, Function f) {
    return Vector(values.unaryExpr([&](double value) { return f(sign * value, sub.kappa); }));
  };
  Iterate r(problem);
  r.z() = dense(problem.Q) * x.z() + problem.g + A.transpose() * x.y() + C.transpose() * x.lambda_w() +
          L.transpose() * x.lambda_L() + R.transpose() * x.lambda_R();
  r.sigma() = every(x.sigma(), -1.0, side_slope(sub)).cwiseProduct(x.lambda_R()) -
              every(x.sigma(), 1.0, side_slope(sub)).cwiseProduct(x.lambda_L());
  r.v() = x.lambda_w() + every(x.v(), -1.0, p);
  r.y() = (sub.equality_estimate - x.y()) / sub.rho + A * x.z() + problem.b;
  r.lambda_w() = (sub.row_estimate.inequality() - x.lambda_w()) / sub.rho + C * x.z() + d_of(problem) -
                 every(x.v(), 1.0, p);
  r.lambda_L() = (sub.row_estimate.s() - x.lambda_L()) / sub.rho + L * x.z() + l_of(problem) -
                 every(x.sigma(), 1.0, side(sub));
  r.lambda_R() = (sub.row_estimate.t() - x.lambda_R()) / sub.rho + R * x.z() + r_of(problem) -
                 every(x.sigma(), -1.0, side(sub));
  return r.all;
}

double pair_curvature(const Subproblem& sub, const Iterate& x, Index i, bool clip) {
  const Function curvature = side_curvature(sub);
  const double q = -curvature(x.sigma()[i], sub.kappa) * x.lambda_L()[i] -
                   curvature(-x.sigma()[i], sub.kappa) * x.lambda_R()[i];
  return clip && q < 0.0 ? 0.0 : q;
}

Eigen::MatrixXd full_jacobian(const ScaledProblem& problem, const Subproblem& sub, const Iterate& x,
                              double delta, bool clip) {
  const Index n = problem.variables(), n_c = problem.pairs(), n_i = problem.inequalities(),
              n_e = problem.equalities();
  const Index sigma = n, v = sigma + n_c, y = v + n_i, w = y + n_e, left = w + n_i, right = left + n_c;
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(right + n_c, right + n_c);
  J.topLeftCorner(n, n) = dense(problem.Q) + delta * Eigen::MatrixXd::Identity(n, n);
  const auto couple = [&](const RowMatrix& m, Index at) {
    J.block(at, 0, m.rows, n) = dense(m);
    J.block(0, at, n, m.rows) = dense(m).transpose();
    J.block(at, at, m.rows, m.rows).diagonal().setConstant(-1.0 / sub.rho);
  };
  couple(problem.A, y);
  couple(C_of(problem), w);
  couple(L_of(problem), left);
  couple(R_of(problem), right);
  for (Index i = 0; i < n_i; ++i) {
    J(v + i, v + i) = -p_slope(-x.v()[i], sub.kappa);
    J(v + i, w + i) = 1.0;
    J(w + i, v + i) = -p_slope(x.v()[i], sub.kappa);
  }
  for (Index i = 0; i < n_c; ++i) {
    J(sigma + i, sigma + i) = pair_curvature(sub, x, i, clip) + delta;
    J(sigma + i, left + i) = J(left + i, sigma + i) = -side_slope(sub)(x.sigma()[i], sub.kappa);
    J(sigma + i, right + i) = J(right + i, sigma + i) = side_slope(sub)(-x.sigma()[i], sub.kappa);
  }
  return J;
}

Eigen::MatrixXd dense_system(const ScaledProblem& problem, const RowWeights& weights) {
  const Index n = problem.variables(), n_e = problem.equalities();
  const Eigen::MatrixXd A = dense(problem.A), C = dense(C_of(problem)), L = dense(L_of(problem)),
                        R = dense(R_of(problem));
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n + n_e, n + n_e);
  Eigen::MatrixXd H = dense(problem.Q) + weights.delta * Eigen::MatrixXd::Identity(n, n);
  H += C.transpose() * weights.rows.inequality().asDiagonal() * C;
  for (Index i = 0; i < problem.pairs(); ++i) {
    const Eigen::RowVectorXd first = weights.cosine[i] * L.row(i) + weights.sine[i] * R.row(i);
    const Eigen::RowVectorXd second = weights.sine[i] * L.row(i) - weights.cosine[i] * R.row(i);
    H += weights.rows.s()[i] * first.transpose() * first + weights.rows.t()[i] * second.transpose() * second;
  }
  K.topLeftCorner(n, n) = H;
  K.topRightCorner(n, n_e) = A.transpose();
  K.bottomLeftCorner(n_e, n) = A;
  K.bottomRightCorner(n_e, n_e).diagonal().setConstant(-1.0 / weights.rho);
  return K;
}

}  // namespace marble::testing
