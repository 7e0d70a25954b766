#include "lcs/riccati.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "model/tuning.h"

namespace marble {

Expected<std::vector<double>> riccati(const SmallLcp::ConstMap& A, const SmallLcp::ConstMap& B,
                                      const SmallLcp::ConstMap& Q, const SmallLcp::ConstMap& R) {
  using Matrix = Eigen::MatrixXd;
  const auto failed = [](const char* why) {
    return unexpected(failure(ErrorCode::failed_precondition, "P", why));
  };
  const Eigen::LLT<Matrix> root(R);
  if (root.info() != Eigen::Success)
    return failed("must be given, as R is not positive definite: there is no Riccati equation");
  const Eigen::Index n = A.rows();
  Matrix a = A, h = Q;
  Matrix g = B * root.solve(Matrix(B.transpose()));
  for (int pass = 0; pass < tuning::riccati_passes; ++pass) {
    const Eigen::PartialPivLU<Matrix> w(Matrix(Matrix::Identity(n, n) + g * h));
    const Matrix wa = w.solve(a);
    const Matrix change = a.transpose() * h * wa;
    const Matrix next_g = g + a * w.solve(g) * a.transpose();
    h += 0.5 * (change + change.transpose());
    g = 0.5 * (next_g + next_g.transpose());
    a = (a * wa).eval();
    if (!h.allFinite() || !g.allFinite() || !a.allFinite()) break;
    if (change.cwiseAbs().maxCoeff() > tuning::rounding * (1.0 + h.cwiseAbs().maxCoeff())) continue;
    std::vector<double> values(static_cast<std::size_t>(n * n));
    Eigen::Map<Matrix>(values.data(), n, n) = h;  // symmetric, so in either order
    return values;
  }
  return failed("must be given: the Riccati equation of A, B, Q and R has no stabilizing solution");
}

}  // namespace marble
