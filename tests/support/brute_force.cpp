#include "support/brute_force.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "support/dense_algebra.h"

namespace marble::testing {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFeasible = 1e-7;   // of rows of norm 1
constexpr double kRunaway = 1e7;     // for rows of norm 1: an iterate this far out counts as unbounded
constexpr double kConverged = 1e-7;  // residuals of the optimality conditions beside the gradient's size
constexpr double kSuspect = 1e3;     // for rows of norm 1: an iterate this far out may diverge to −∞

// min ½ yᵀHy + cᵀy  s.t.  G y + h ≥ 0
struct Branch {
  Matrix H, G;
  Vector c, h;
};

Matrix dense(const SparseMatrixView& m, Eigen::Index rows, Eigen::Index columns) {
  Matrix out = Matrix::Zero(rows, columns);
  for (Eigen::Index j = 0; j < columns && !m.values.empty(); ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out(m.row_indices[k], j) = m.values[k];
  }
  return out;
}

Vector dense(std::span<const double> v) {
  return Eigen::Map<const Vector>(v.data(), static_cast<Eigen::Index>(v.size()));
}

struct InteriorPoint {
  Vector y;
  double error;  // the largest residual of the optimality conditions, of rows of norm 1
};

// Up to kMost rows and columns without a call of malloc, which costs a small problem more than its numbers
// do.
template <int kMost>
struct Bounded {
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMost, kMost>;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMost, 1>;
  explicit Bounded(const Branch& p) : H(p.H), G(p.G), c(p.c), h(p.h) {}
  Matrix H, G;
  Vector c, h;
};

template <class Vector>
double largest(const Vector& v) {
  return v.size() > 0 ? v.cwiseAbs().maxCoeff() : 0.0;
}

template <class Vector>
double longest_step(const Vector& x, const Vector& dx) {
  double step = 1.0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    if (dx[i] < 0.0) step = std::min(step, -x[i] / dx[i]);
  }
  return step;
}

// Mehrotra's predictor-corrector method from an infeasible start.
template <int kMost>
InteriorPoint interior_point(const Bounded<kMost>& p) {
  using Rows = typename Bounded<kMost>::Matrix;
  using Values = typename Bounded<kMost>::Vector;
  const Eigen::Index m = p.h.size();
  Values y = Values::Zero(p.c.size());
  Values w = (p.G * y + p.h).cwiseAbs().cwiseMax(1.0);
  Values nu = Values::Ones(m);
  double error = kInfinity;
  for (int iteration = 0; iteration < 200; ++iteration) {
    const Values dual = p.H * y + p.c - p.G.transpose() * nu;
    const Values primal = p.G * y + p.h - w;
    const double mu = m > 0 ? w.dot(nu) / static_cast<double>(m) : 0.0;
    error = std::max({largest(dual), mu, largest(primal)});
    if (error < 1e-12 || largest(y) > kRunaway) break;
    Rows normal = p.H + p.G.transpose() * nu.cwiseQuotient(w).asDiagonal() * p.G;
    normal.diagonal().array() += 1e-14 * (1.0 + normal.diagonal().maxCoeff());
    const Eigen::LDLT<Rows> factor(normal);
    Values dy, dw, dnu;
    const auto direction = [&](const Values& products) {
      dy = factor.solve(-dual - p.G.transpose() * (products + nu.cwiseProduct(primal)).cwiseQuotient(w));
      dw = p.G * dy + primal;
      dnu = -(products + nu.cwiseProduct(dw)).cwiseQuotient(w);
    };
    direction(w.cwiseProduct(nu));
    const double predicted_primal = longest_step(w, dw);
    const double predicted_dual = longest_step(nu, dnu);
    if (m > 0) {
      const double predicted =
          (w + predicted_primal * dw).dot(nu + predicted_dual * dnu) / static_cast<double>(m);
      const double center = mu * std::pow(predicted / mu, 3);
      direction((w.cwiseProduct(nu) + dw.cwiseProduct(dnu)).array() - center);
    }
    // One step length for both: with different ones the dual residual of a QP need not decrease.
    const double step = std::min(1.0, 0.995 * std::min(longest_step(w, dw), longest_step(nu, dnu)));
    if (!dy.allFinite() || step < 1e-12) break;
    y += step * dy;
    w += step * dw;
    nu += step * dnu;
  }
  return {y, error};
}

InteriorPoint interior_point(const Branch& p) {
  constexpr int kFew = 24;
  if (p.c.size() <= kFew && p.h.size() <= kFew) return interior_point(Bounded<kFew>(p));
  return interior_point(Bounded<Eigen::Dynamic>(p));
}

double violation(const Branch& p, const Vector& y) {
  return p.h.size() > 0 ? std::max(0.0, -(p.G * y + p.h).minCoeff()) : 0.0;
}

// Returns the least violation of G y + h ≥ 0, by the linear program over (y, violation), which is always
// feasible.
double least_violation(const Branch& p) {
  const Eigen::Index n = p.c.size();
  const Eigen::Index m = p.h.size();
  Branch phase;
  phase.H = Matrix::Zero(n + 1, n + 1);
  phase.H.topLeftCorner(n, n).diagonal().setConstant(1e-10);  // selects one of small norm among these y
  phase.c = Vector::Unit(n + 1, n);
  phase.G = Matrix::Zero(m + 1, n + 1);
  phase.G.topLeftCorner(m, n) = p.G;
  phase.G.col(n).setOnes();
  phase.h = Vector::Zero(m + 1);
  phase.h.head(m) = p.h;
  return violation(p, interior_point(phase).y.head(n));
}

// Returns whether a feasible branch has a feasible direction along which its objective decreases without
// bound.
bool is_unbounded(const Branch& p) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(p.H);
  const double flat = 1e-9 * std::max(1.0, eigen.eigenvalues().maxCoeff());
  const Eigen::Index count = (eigen.eigenvalues().array() <= flat).count();
  if (count == 0) return false;
  const Matrix basis = eigen.eigenvectors().leftCols(count);
  const Eigen::Index m = p.h.size();
  Branch cone;
  cone.H = 1e-10 * Matrix::Identity(count, count);
  cone.c = basis.transpose() * p.c;
  cone.G = Matrix::Zero(m + 2 * count, count);
  cone.G.topRows(m) = p.G * basis;
  cone.G.middleRows(m, count).setIdentity();
  cone.G.bottomRows(count) = -Matrix::Identity(count, count);
  cone.h = Vector::Zero(m + 2 * count);
  cone.h.tail(2 * count).setOnes();
  return cone.c.dot(interior_point(cone).y) < -1e-6 * (1.0 + p.c.norm());
}

// Scales rows to norm 1; a row without entries only restricts its constant.
bool normalize(Matrix& rows, Vector& constants, bool equality) {
  Eigen::Index kept = 0;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const double norm = rows.row(i).norm();
    if (norm <= 1e-12) {
      if (equality ? std::abs(constants[i]) > kFeasible : constants[i] < -kFeasible) return false;
      continue;
    }
    rows.row(kept) = (rows.row(i) / norm).eval();
    constants[kept++] = constants[i] / norm;
  }
  rows.conservativeResize(kept, Eigen::NoChange);
  constants.conservativeResize(kept);
  return true;
}

// An LCQP with dense data, in variables scaled by the diagonal of Q.
struct Dense {
  explicit Dense(const ProblemView& p)
      : g(dense(p.g)), b(dense(p.b)), d(dense(p.d)), l(dense(p.l)), r(dense(p.r)) {
    const Eigen::Index n = g.size();
    Q = dense(p.Q, n, n);
    if (p.hessian_form == HessianForm::upper_triangle) Q = Matrix(Q.selfadjointView<Eigen::Upper>());
    scale = Q.diagonal().unaryExpr([](double q) { return q > 0.0 ? 1.0 / std::sqrt(q) : 1.0; });
    Q = scale.asDiagonal() * Q * scale.asDiagonal();
    g = g.cwiseProduct(scale);
    A = dense(p.A, b.size(), n) * scale.asDiagonal();
    C = dense(p.C, d.size(), n) * scale.asDiagonal();
    L = dense(p.L, l.size(), n) * scale.asDiagonal();
    R = dense(p.R, r.size(), n) * scale.asDiagonal();
  }
  Vector g, b, d, l, r, scale;
  Matrix Q, A, C, L, R;
};

struct BestPoint {
  Vector x;
  bool unbounded = false;
  bool converged = true;
};

// Solves the branch where the pairs of `choice` have t = 0 and the others s = 0.
std::optional<BestPoint> best_point(const Dense& p, unsigned choice) {
  const Eigen::Index n = p.g.size();
  const Eigen::Index pairs = p.l.size();
  Matrix E(p.A.rows() + pairs, n);
  Matrix F(p.C.rows() + pairs, n);
  Vector e(E.rows());
  Vector f(F.rows());
  E.topRows(p.A.rows()) = p.A;
  e.head(p.A.rows()) = p.b;
  F.topRows(p.C.rows()) = p.C;
  f.head(p.C.rows()) = p.d;
  for (Eigen::Index i = 0; i < pairs; ++i) {
    const bool right = ((choice >> i) & 1U) != 0;
    E.row(p.A.rows() + i) = right ? p.R.row(i) : p.L.row(i);
    e[p.A.rows() + i] = right ? p.r[i] : p.l[i];
    F.row(p.C.rows() + i) = right ? p.L.row(i) : p.R.row(i);
    f[p.C.rows() + i] = right ? p.l[i] : p.r[i];
  }
  if (!normalize(E, e, true)) return std::nullopt;

  // Equalities reduce z to point + basis · y.
  Vector point = Vector::Zero(n);
  Matrix basis = Matrix::Identity(n, n);
  if (E.rows() > 0) {
    Eigen::ColPivHouseholderQR<Matrix> qr(E.transpose());
    qr.setThreshold(1e-10);
    const Eigen::Index rank = qr.rank();
    const Matrix orthogonal = qr.householderQ();
    const Matrix range = orthogonal.leftCols(rank);
    point = range * (E * range).colPivHouseholderQr().solve(-e);
    if ((E * point + e).lpNorm<Eigen::Infinity>() > kFeasible * (1.0 + point.norm())) return std::nullopt;
    basis = orthogonal.rightCols(n - rank);
  }
  Branch branch{basis.transpose() * p.Q * basis, F * basis, basis.transpose() * (p.Q * point + p.g),
                F * point + f};
  if (basis.cols() == 0) {
    if (f.size() > 0 && branch.h.minCoeff() < -kFeasible * (1.0 + point.norm())) return std::nullopt;
    return BestPoint{point};
  }
  if (eigenvalues(branch.H)[0] < -1e-9) throw std::invalid_argument("Q is not convex on a branch");
  if (!normalize(branch.G, branch.h, false)) return std::nullopt;
  const auto [y, error] = interior_point(branch);
  const double feasible = kFeasible * (1.0 + point.norm());
  // NaN is no proof either.
  if (!(violation(branch, y) <= feasible) && least_violation(branch) > feasible) return std::nullopt;
  const Vector x = point + basis * y;
  return BestPoint{x, x.lpNorm<Eigen::Infinity>() > kSuspect && is_unbounded(branch),
                   error <= kConverged * (1.0 + branch.c.lpNorm<Eigen::Infinity>())};
}

}  // namespace

std::optional<GlobalOptimum> brute_force(const ProblemView& view) {
  if (view.l.size() > 12) throw std::invalid_argument("more than 12 pairs");
  const Dense p(view);
  std::optional<GlobalOptimum> best;
  for (unsigned choice = 0; choice < (1U << view.l.size()); ++choice) {
    const auto branch = best_point(p, choice);
    if (!branch) continue;
    const auto& [x, unbounded, converged] = *branch;
    if (!best) best.emplace().objective = kInfinity;
    ++best->feasible_branches;
    best->certain = best->certain && (converged || unbounded);
    const double objective = unbounded ? -kInfinity : 0.5 * x.dot(p.Q * x) + p.g.dot(x) + view.c0;
    if (objective >= best->objective) continue;
    best->objective = objective;
    const Vector z = p.scale.cwiseProduct(x);
    best->z = unbounded ? std::vector<double>{} : std::vector<double>(z.begin(), z.end());
  }
  return best;
}

Status true_status(const std::optional<GlobalOptimum>& optimum) {
  if (!optimum) return Status::infeasible;
  return std::isinf(optimum->objective) ? Status::unbounded : Status::solved;
}

}  // namespace marble::testing
