#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "marble/convert.h"
#include "requests/dense.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "support/dense_algebra.h"
#include "support/independent_check.h"

namespace marble::fuzz {
namespace {

constexpr double kZero = 1e-5;          // of a side or a multiplier: below it may count as zero
constexpr double kModerate = 1e4;       // of the numbers of an answer
constexpr double kExact = 1e-9;         // of the residuals of an exact solution
constexpr double kOfDerivative = 1e-6;  // of a derivative, of its largest term

// The part of the k-th of those that follow one another; zeros where there are none.
template <class Numbers>
Vector part(const Numbers& all, int k, std::size_t size) {
  const auto count = static_cast<Eigen::Index>(size);
  if (all.empty()) return Vector::Zero(count);
  FUZZ_JUDGE(static_cast<std::size_t>(all.size()) >= (static_cast<std::size_t>(k) + 1) * size);
  return Eigen::Map<const Vector>(all.data() + static_cast<Eigen::Index>(k) * count, count);
}

std::span<const double> numbers(const Vector& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }

// A problem's numbers, or their changes, dense.
struct Parts {
  Matrix Q, A, C, L, R;
  Vector g, b, d, l, r;
};

Parts parts_of(const ProblemView& p) {
  const auto n = static_cast<Eigen::Index>(p.g.size());
  const auto rows = [&](const SparseMatrixView& m, std::span<const double> offset) {
    return dense(m, static_cast<Eigen::Index>(offset.size()), n, m.values);
  };
  return {dense_hessian(p, p.Q.values),
          rows(p.A, p.b),
          rows(p.C, p.d),
          rows(p.L, p.l),
          rows(p.R, p.r),
          dense(p.g),
          dense(p.b),
          dense(p.d),
          dense(p.l),
          dense(p.r)};
}

Parts direction(const ProblemView& p, const v1::ProblemNumbers& all, int k) {
  const auto n = static_cast<Eigen::Index>(p.g.size());
  const auto rows = [&](const SparseMatrixView& m, std::span<const double> offset, const auto& values) {
    const Vector own = part(values, k, m.values.size());
    return dense(m, static_cast<Eigen::Index>(offset.size()), n, numbers(own));
  };
  const Vector Q = part(all.hessian_values(), k, p.Q.values.size());
  return {dense_hessian(p, numbers(Q)),
          rows(p.A, p.b, all.equality_values()),
          rows(p.C, p.d, all.inequality_values()),
          rows(p.L, p.l, all.left_values()),
          rows(p.R, p.r, all.right_values()),
          part(all.gradient(), k, p.g.size()),
          part(all.equality_offset(), k, p.b.size()),
          part(all.inequality_offset(), k, p.d.size()),
          part(all.left_offset(), k, p.l.size()),
          part(all.right_offset(), k, p.r.size())};
}

// The vectors of an answer, or of its change.
struct Vectors {
  Vector z, y, nu, xi, eta;
};

template <class Message>
Vectors vectors_of(const ProblemView& p, const Message& all, int k) {
  return {part(all.z(), k, p.g.size()), part(all.equality_multipliers(), k, p.b.size()),
          part(all.inequality_multipliers(), k, p.d.size()),
          part(all.complementarity_multipliers_l(), k, p.l.size()),
          part(all.complementarity_multipliers_r(), k, p.r.size())};
}

double size_of(const Vector& v) { return v.size() > 0 ? v.lpNorm<Eigen::Infinity>() : 0.0; }

bool is_moderate(const Vectors& x) {
  const auto moderate = [](const Vector& v) { return size_of(v) <= kModerate; };
  return moderate(x.z) && moderate(x.y) && moderate(x.nu) && moderate(x.xi) && moderate(x.eta);
}

// A row that is not zero has no multiplier, one with a multiplier stays zero, of others one of both.
void expect_on_branch(const Vector& row, const Vector& multiplier, const Vector& row_change,
                      const Vector& multiplier_change, double tolerance) {
  for (Eigen::Index i = 0; i < row.size(); ++i) {
    const bool moves = std::abs(row_change[i]) > tolerance;
    const bool pulls = std::abs(multiplier_change[i]) > tolerance;
    if (row[i] > kZero) FUZZ_JUDGE(!pulls);
    if (std::abs(multiplier[i]) > kZero) FUZZ_JUDGE(!moves);
    FUZZ_JUDGE(!(moves && pulls));
  }
}

void judge_change(const Parts& p, const Vectors& x, const Parts& by, const Vectors& change) {
  const double size =
      1.0 + (1.0 + size_of(x.z) + size_of(x.y) + size_of(x.nu) + size_of(x.xi) + size_of(x.eta)) * 10.0 +
      10.0 * (size_of(change.z) + size_of(change.y) + size_of(change.nu) + size_of(change.xi) +
              size_of(change.eta));
  const double tolerance = kOfDerivative * 10.0 * size;
  const Vector gradient = p.Q * change.z + by.Q * x.z + by.g + p.A.transpose() * change.y +
                          by.A.transpose() * x.y - p.C.transpose() * change.nu - by.C.transpose() * x.nu -
                          p.L.transpose() * change.xi - by.L.transpose() * x.xi -
                          p.R.transpose() * change.eta - by.R.transpose() * x.eta;
  FUZZ_JUDGE_AT_MOST(size_of(gradient), tolerance);
  FUZZ_JUDGE_AT_MOST(size_of(p.A * change.z + by.A * x.z + by.b), tolerance);
  const auto expect = [&](const Matrix& rows, const Vector& offset, const Vector& multiplier,
                          const Matrix& rows_by, const Vector& offset_by, const Vector& multiplier_by) {
    expect_on_branch(rows * x.z + offset, multiplier, rows * change.z + rows_by * x.z + offset_by,
                     multiplier_by, tolerance);
  };
  expect(p.C, p.d, x.nu, by.C, by.d, change.nu);
  expect(p.L, p.l, x.xi, by.L, by.l, change.xi);
  expect(p.R, p.r, x.eta, by.R, by.r, change.eta);
}

// A loss along a direction, by the change and by the gradient.
void judge_gradients(const ProblemView& p, const v1::SensitivityRequest& request,
                     const v1::Sensitivity& reported) {
  const auto is_undefined = [](const auto& undefined, int k) {
    return std::find(undefined.begin(), undefined.end(), k) != undefined.end();
  };
  for (int k = 0; k < request.directions().count(); ++k) {
    if (is_undefined(reported.changes().undefined(), k)) continue;
    const Vectors change = vectors_of(p, reported.changes().vectors(), k);
    for (int loss = 0; loss < request.losses().count(); ++loss) {
      if (is_undefined(reported.gradients().undefined(), loss)) continue;
      double forward = 0.0, adjoint = 0.0, size = 1.0;
      const auto add = [&size](double& sum, const Vector& a, const Vector& b) {
        sum += a.dot(b);
        size += a.cwiseAbs().dot(b.cwiseAbs());
      };
      const Vectors weights = vectors_of(p, request.losses().weights(), loss);
      add(forward, weights.z, change.z), add(forward, weights.y, change.y);
      add(forward, weights.nu, change.nu), add(forward, weights.xi, change.xi);
      add(forward, weights.eta, change.eta);
      const v1::ProblemNumbers &by = request.directions().numbers(), &own = reported.gradients().numbers();
      const auto along = [&](const auto& gradient, const auto& numbers, std::size_t count) {
        add(adjoint, part(gradient, loss, count), part(numbers, k, count));
      };
      along(own.gradient(), by.gradient(), p.g.size());
      along(own.equality_offset(), by.equality_offset(), p.b.size());
      along(own.inequality_offset(), by.inequality_offset(), p.d.size());
      along(own.left_offset(), by.left_offset(), p.l.size());
      along(own.right_offset(), by.right_offset(), p.r.size());
      along(own.hessian_values(), by.hessian_values(), p.Q.values.size());
      along(own.equality_values(), by.equality_values(), p.A.values.size());
      along(own.inequality_values(), by.inequality_values(), p.C.values.size());
      along(own.left_values(), by.left_values(), p.L.values.size());
      along(own.right_values(), by.right_values(), p.R.values.size());
      ++tally().derivatives;
      FUZZ_JUDGE_AT_MOST(std::abs(forward - adjoint), 10.0 * kOfDerivative * size);
    }
  }
}

// S = E P E' with P = Z inv(Z'QZ) Z', Z a basis of what the rows at zero leave.
void judge_rows(const Parts& p, const Vectors& x, const v1::RowsRequest& request,
                const v1::Sensitivity& reported) {
  if (reported.rows().has_error()) return;
  const Eigen::Index m = request.matrix().rows(), n = p.g.size();
  const SparseMatrixView E_view = view_of(request.matrix());
  const Matrix E = dense(E_view, m, n, E_view.values);
  if (E.size() > 0 && (E.cwiseAbs().maxCoeff() > 1e3)) return;
  const Vector values = part(reported.rows().values(), 0, static_cast<std::size_t>(m));
  FUZZ_JUDGE_AT_MOST(size_of(values - E * x.z), kZero * (1.0 + (E.cwiseAbs() * x.z.cwiseAbs()).maxCoeff()));
  if (!request.proximal().empty() || !reported.weak_inequalities().empty() ||
      !reported.biactive_pairs().empty())
    return;
  Matrix rows = p.A;
  const auto take = [&](const Matrix& from, const Vector& offset) {
    for (Eigen::Index i = 0; i < from.rows(); ++i) {
      if (from.row(i).dot(x.z) + offset[i] > kZero) continue;
      rows.conservativeResize(rows.rows() + 1, n);
      rows.row(rows.rows() - 1) = from.row(i);
    }
  };
  take(p.C, p.d), take(p.L, p.l), take(p.R, p.r);
  Matrix basis = Matrix::Identity(n, n);
  if (rows.rows() > 0) {
    Eigen::FullPivLU<Matrix> lu(rows);
    if (lu.dimensionOfKernel() == 0) {
      basis = Matrix::Zero(n, 0);
    } else {
      basis = lu.kernel();
    }
  }
  Matrix S = Matrix::Zero(m, m);
  if (basis.cols() > 0) {
    const Matrix reduced = basis.transpose() * p.Q * basis, seen = E * basis;
    if (testing::eigenvalues(reduced)[0] < 1e-6) return;  // flat, if not along these rows
    for (Eigen::Index j = 0; j < m; ++j)
      S.col(j) = seen * testing::dense_solve(reduced, seen.row(j).transpose());
  }
  const Vector response = part(reported.rows().response(), 0, static_cast<std::size_t>(m * (m + 1) / 2));
  ++tally().derivatives;
  const double size = 1.0 + (m > 0 ? S.cwiseAbs().maxCoeff() : 0.0);
  for (Eigen::Index j = 0; j < m; ++j) {
    for (Eigen::Index i = 0; i <= j; ++i)
      FUZZ_JUDGE_AT_MOST(std::abs(response[i + j * (j + 1) / 2] - S(i, j)), 1e-5 * size);
  }
}

bool is_friendly_direction(const v1::ProblemNumbers& numbers) {
  const auto small = [](const auto& values) {
    return std::all_of(values.begin(), values.end(), [](double v) { return std::abs(v) <= 1e3; });
  };
  return small(numbers.gradient()) && small(numbers.equality_offset()) &&
         small(numbers.inequality_offset()) && small(numbers.left_offset()) &&
         small(numbers.right_offset()) && small(numbers.hessian_values()) &&
         small(numbers.equality_values()) && small(numbers.inequality_values()) &&
         small(numbers.left_values()) && small(numbers.right_values());
}

bool is_friendly_loss(const v1::AnswerVectors& weights) {
  const auto small = [](const auto& values) {
    return std::all_of(values.begin(), values.end(), [](double v) { return std::abs(v) <= 1e3; });
  };
  return small(weights.z()) && small(weights.equality_multipliers()) &&
         small(weights.inequality_multipliers()) && small(weights.complementarity_multipliers_l()) &&
         small(weights.complementarity_multipliers_r());
}

// Each row is zero, or its multiplier is.
bool is_on_branch(const Vector& row, const Vector& multiplier) {
  return row.size() == 0 || row.cwiseAbs().cwiseMin(multiplier.cwiseAbs()).maxCoeff() <= kZero;
}

// Derivatives are those of the branch's exact solution. An answer with loose tolerances is another point, and
// far out on a flat ray only the largest of them mean something.
bool is_exact(const ProblemView& view, const Parts& p, const Vectors& x, const v1::Solution& answer) {
  if (!is_moderate(x) || !is_on_branch(p.C * x.z + p.d, x.nu) || !is_on_branch(p.L * x.z + p.l, x.xi) ||
      !is_on_branch(p.R * x.z + p.r, x.eta))
    return false;
  const testing::Verdict verdict = testing::judge(view, solution_of(answer));
  return std::max({verdict.infeasibility(), verdict.stationarity, verdict.slackness}) <= kExact;
}

}  // namespace

void judge_derivatives(const ProblemView& view, const v1::SensitivityRequest& request,
                       const v1::Solution& answer) {
  FUZZ_JUDGE(answer.has_sensitivity());
  const v1::Sensitivity& reported = answer.sensitivity();
  if (reported.has_error()) return;
  FUZZ_JUDGE(answer.status() == v1::STATUS_SOLVED || answer.status() == v1::STATUS_ALMOST_SOLVED);
  FUZZ_JUDGE(reported.changes().active_set_constant_size() == request.directions().count());
  if (!is_friendly(view)) return;
  const Parts p = parts_of(view);
  const Vectors x = vectors_of(view, answer, 0);
  if (!is_exact(view, p, x, answer)) return;
  const bool directions = is_friendly_direction(request.directions().numbers());
  for (int k = 0; k < request.directions().count() && directions; ++k) {
    const auto& undefined = reported.changes().undefined();
    if (std::find(undefined.begin(), undefined.end(), k) != undefined.end()) continue;
    ++tally().derivatives;
    judge_change(p, x, direction(view, request.directions().numbers(), k),
                 vectors_of(view, reported.changes().vectors(), k));
  }
  if (directions && is_friendly_loss(request.losses().weights())) judge_gradients(view, request, reported);
  if (request.has_rows()) judge_rows(p, x, request.rows(), reported);
}

}  // namespace marble::fuzz
