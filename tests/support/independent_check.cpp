#include "support/independent_check.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace marble::testing {
namespace {

using Values = std::vector<double>;

// NaN counts as infinite.
void worsen(double& worst, double value) {
  worst = std::isnan(value) ? std::numeric_limits<double>::infinity() : std::max(worst, value);
}

Values times(const SparseMatrixView& m, const Values& z, std::span<const double> offset) {
  Values out(offset.begin(), offset.end());
  for (Index j = 0; j < m.columns && !m.values.empty(); ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out[m.row_indices[k]] += m.values[k] * z[j];
  }
  return out;
}

struct Sum {
  Values value, size;
  void add(std::size_t i, double term) {
    value[i] += term;
    size[i] = std::max(size[i], std::abs(term));
  }
};

void add_transposed(const SparseMatrixView& m, const Values& y, double sign, Sum& sum) {
  for (Index j = 0; j < m.columns && !m.values.empty(); ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      sum.add(j, sign * m.values[k] * y[m.row_indices[k]]);
  }
}

double largest(const Values& v) {
  double worst = 0.0;
  for (const double x : v) worsen(worst, std::abs(x));
  return worst;
}

}  // namespace

double Verdict::infeasibility() const { return std::max({equality, inequality, complementarity}); }

Verdict judge(const ProblemView& p, const Solution& x) {
  Verdict v;
  const Values& z = x.z;
  Sum sum{Values(p.g.begin(), p.g.end()), Values(p.g.size(), 0.0)};
  for (std::size_t i = 0; i < p.g.size(); ++i) sum.size[i] = std::abs(p.g[i]);
  v.objective = p.c0;
  for (std::size_t i = 0; i < p.g.size(); ++i) v.objective += p.g[i] * z[i];
  for (Index j = 0; j < p.Q.columns && !p.Q.values.empty(); ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const Index i = p.Q.row_indices[k];
      const double q = p.Q.values[k];
      sum.add(i, q * z[j]);
      v.objective += 0.5 * q * z[i] * z[j];
      if (p.hessian_form == HessianForm::upper_triangle && i != j) {
        sum.add(j, q * z[i]);
        v.objective += 0.5 * q * z[i] * z[j];
      }
    }
  }
  add_transposed(p.A, x.equality_multipliers, 1.0, sum);
  add_transposed(p.C, x.inequality_multipliers, -1.0, sum);
  add_transposed(p.L, x.complementarity_multipliers_L, -1.0, sum);
  add_transposed(p.R, x.complementarity_multipliers_R, -1.0, sum);
  for (std::size_t i = 0; i < p.g.size(); ++i) {
    worsen(v.stationarity, std::abs(sum.value[i]) / (1.0 + sum.size[i]));
    worsen(v.absolute_stationarity, std::abs(sum.value[i]));
  }

  for (const double row : times(p.A, z, p.b)) worsen(v.equality, std::abs(row));
  const double size =
      1.0 + std::max({largest(x.inequality_multipliers), largest(x.complementarity_multipliers_L),
                      largest(x.complementarity_multipliers_R)});
  const Values w = times(p.C, z, p.d);
  for (std::size_t i = 0; i < w.size(); ++i) {
    worsen(v.inequality, -w[i]);
    worsen(v.wrong_sign, -x.inequality_multipliers[i]);
    worsen(v.slackness, std::abs(w[i] * x.inequality_multipliers[i]) / size);
  }
  const Values s = times(p.L, z, p.l);
  const Values t = times(p.R, z, p.r);
  for (std::size_t i = 0; i < s.size(); ++i) {
    worsen(v.complementarity, std::abs(std::min(s[i], t[i])));
    worsen(v.slackness, std::abs(s[i] * x.complementarity_multipliers_L[i]) / size);
    worsen(v.slackness, std::abs(t[i] * x.complementarity_multipliers_R[i]) / size);
  }
  return v;
}

Verdict judge_point(const ProblemView& problem, const std::vector<double>& z) {
  Solution point;
  point.z = z;
  point.equality_multipliers.resize(problem.b.size());
  point.inequality_multipliers.resize(problem.d.size());
  point.complementarity_multipliers_L.resize(problem.l.size());
  point.complementarity_multipliers_R.resize(problem.l.size());
  return judge(problem, point);
}

}  // namespace marble::testing
