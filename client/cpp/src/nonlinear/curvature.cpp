#include "nonlinear/curvature.h"

#include <algorithm>
#include <cmath>

#include "nonlinear/algebra.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

/// Returns an upper triangle with the diagonal and, in each column, the rows that `rows_above` adds.
template <class RowsAbove>
SparseMatrix pattern(Index n, const RowsAbove& rows_above) {
  SparseMatrix made{.rows = n, .columns = n, .column_pointers = {0}, .row_indices = {}, .values = {}};
  for (Index j = 0; j < n; ++j) {
    const auto first = made.row_indices.size();
    rows_above(j, made.row_indices);
    const auto begin = made.row_indices.begin() + static_cast<std::ptrdiff_t>(first);
    std::sort(begin, made.row_indices.end());
    made.row_indices.erase(std::unique(begin, made.row_indices.end()), made.row_indices.end());
    if (made.row_indices.size() == first || made.row_indices.back() != j) made.row_indices.push_back(j);
    made.column_pointers.push_back(static_cast<Index>(made.row_indices.size()));
  }
  made.values.assign(made.row_indices.size(), 0.0);
  return made;
}

}  // namespace

Curvature chosen(Curvature kind, const Problem& problem, const Point& point) {
  if (kind != Curvature::automatic) return kind;
  if (problem.hessian) return Curvature::exact;
  return point.residuals.empty() ? Curvature::bfgs : Curvature::gauss_newton;
}

Expected<Model> Model::create(Curvature kind, Functions& functions, const Point& point,
                              const Linearisation& first, const Multipliers& multipliers) {
  Model made;
  made.kind_ = kind;
  const auto n = static_cast<Index>(functions.variables());
  for (const double scale : functions.scale()) made.inverse_scale_squared_.push_back(1.0 / (scale * scale));
  if (kind == Curvature::exact) {
    MARBLE_RETURN_IF_ERROR(functions.hessian(point, multipliers, made.hessian_));
    const SparseMatrix& H = made.hessian_;
    made.upper_ = pattern(n, [&](Index j, std::vector<Index>& rows) {
      rows.insert(rows.end(), H.row_indices.begin() + H.column_pointers[j],
                  H.row_indices.begin() + H.column_pointers[j + 1]);
    });
    for (Index j = 0; j < n; ++j) {
      const auto begin = made.upper_.row_indices.begin();
      for (Index k = H.column_pointers[j]; k < H.column_pointers[j + 1]; ++k) {
        made.positions_.push_back(static_cast<Index>(
            std::lower_bound(begin + made.upper_.column_pointers[j],
                             begin + made.upper_.column_pointers[j + 1], H.row_indices[k]) -
            begin));
      }
    }
    made.take_hessian({}, {});
  } else if (kind == Curvature::gauss_newton) {
    const SparseMatrix& J = first.residuals;
    std::vector<std::vector<Index>> columns(static_cast<std::size_t>(J.rows));  // of each row, so far
    made.upper_ = pattern(n, [&](Index j, std::vector<Index>& rows) {
      for (Index k = J.column_pointers[j]; k < J.column_pointers[j + 1]; ++k) {
        auto& before = columns[J.row_indices[k]];
        before.push_back(j);
        rows.insert(rows.end(), before.begin(), before.end());
      }
    });
    made.take_gauss_newton(J);
  } else if (kind == Curvature::bfgs) {
    made.blocks_.assign(functions.blocks().begin(), functions.blocks().end());
    made.known_.assign(made.blocks_.size(), false);
    made.product_.resize(static_cast<std::size_t>(n));
    Index begin = 0;
    std::size_t block = 0;
    made.upper_ = pattern(n, [&](Index j, std::vector<Index>& rows) {
      if (j == begin + made.blocks_[block]) begin += made.blocks_[block++];
      for (Index i = begin; i <= j; ++i) rows.push_back(i);
    });
    for (Index j = 0; j < n; ++j) made.entry(j, j) = made.inverse_scale_squared_[j];
  } else {
    made.upper_ = pattern(n, [](Index, std::vector<Index>&) {});
  }
  return made;
}

Expected<void> Model::move(Functions& functions, const Point& point, const Linearisation& at,
                           const Multipliers& multipliers, std::span<const double> step,
                           std::span<const double> change) {
  const double sigma = std::exchange(sigma_, 0.0);
  if (kind_ == Curvature::exact) {
    MARBLE_RETURN_IF_ERROR(functions.hessian(point, multipliers, hessian_));
    take_hessian(step, change);
  } else if (kind_ == Curvature::gauss_newton) {
    take_gauss_newton(at.residuals);
  } else {
    sigma_ = sigma, shift(0.0);
    Index first = 0;
    for (std::size_t block = 0; block < blocks_.size(); first += blocks_[block++]) {
      const auto begin = static_cast<std::size_t>(first), size = static_cast<std::size_t>(blocks_[block]);
      const auto s = step.subspan(begin, size), y = change.subspan(begin, size);
      if (dot(s, s) <= tuning::rounding) continue;
      const double sy = dot(s, y);
      if (!known_[block] && sy > 0.0) {
        const double curvature =
            std::clamp(dot(y, y) / sy, 1.0 / tuning::scaling_bound, tuning::scaling_bound);
        for (Index j = first; j < first + blocks_[block]; ++j) entry(j, j) = curvature;
      }
      known_[block] = true;
      update_block(first, blocks_[block], s, y);
    }
  }
  return {};
}

// At a bound a second derivative may be infinite, such as that of a power, or infinity times a multiplier of
// zero. Then 0 replaces it off the diagonal, and on it the slope's change over the last step.
void Model::take_hessian(std::span<const double> step, std::span<const double> change) {
  std::fill(upper_.values.begin(), upper_.values.end(), 0.0);
  bool finite = true;
  for (Index j = 0; j < upper_.columns; ++j) {
    for (Index k = hessian_.column_pointers[j]; k < hessian_.column_pointers[j + 1]; ++k) {
      double value = hessian_.values[k];
      if (!(std::abs(value) <= tuning::infinite_curvature)) {
        finite = false, value = 0.0;
        if (hessian_.row_indices[k] == j) {
          const double one = inverse_scale_squared_[j];
          const double secant = step.empty() || step[j] == 0.0 ? one : std::abs(change[j] / step[j]);
          value = std::clamp(secant, one / tuning::scaling_bound, one * tuning::scaling_bound);
        }
      }
      upper_.values[positions_[k]] = value;
    }
  }
  if (!finite) ++replaced_;
}

// Column by column: the products of two sorted columns.
void Model::take_gauss_newton(const SparseMatrix& J) {
  for (Index j = 0; j < upper_.columns; ++j) {
    for (Index k = upper_.column_pointers[j]; k < upper_.column_pointers[j + 1]; ++k) {
      const Index i = upper_.row_indices[k];
      double sum = 0.0;
      for (Index a = J.column_pointers[i], b = J.column_pointers[j];
           a < J.column_pointers[i + 1] && b < J.column_pointers[j + 1];) {
        const Index difference = J.row_indices[a] - J.row_indices[b];
        if (difference == 0) sum += J.values[a] * J.values[b];
        a += difference <= 0, b += difference >= 0;
      }
      upper_.values[k] = sum;
    }
  }
}

// B ← B − Bs sᵀB / sᵀBs + r rᵀ / sᵀr with r = θ y + (1 − θ) Bs (Powell 1978; murty-nlp-lectures, MSQP).
void Model::update_block(Index first, Index size, std::span<const double> s, std::span<const double> y) {
  const auto Bs =
      std::span(product_).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(size));
  std::fill(Bs.begin(), Bs.end(), 0.0);
  for (Index j = 0; j < size; ++j) {
    for (Index i = 0; i <= j; ++i) {
      const double value = entry(first + i, first + j);
      Bs[i] += value * s[j];
      if (i != j) Bs[j] += value * s[i];
    }
  }
  const double sBs = dot(s, Bs), sy = dot(s, y);
  if (sBs <= 0.0) return;
  const double theta = sy >= tuning::damping * sBs ? 1.0 : (1.0 - tuning::damping) * sBs / (sBs - sy);
  const double sr = theta * sy + (1.0 - theta) * sBs;
  for (Index j = 0; j < size; ++j) {
    const double rj = theta * y[j] + (1.0 - theta) * Bs[j];
    for (Index i = 0; i <= j; ++i) {
      const double ri = theta * y[i] + (1.0 - theta) * Bs[i];
      entry(first + i, first + j) += ri * rj / sr - Bs[i] * Bs[j] / sBs;
    }
  }
}

void Model::shift(double sigma) {
  for (Index j = 0; j < upper_.columns; ++j)
    upper_.values[upper_.column_pointers[j + 1] - 1] += (sigma - sigma_) * inverse_scale_squared_[j];
  sigma_ = sigma;
}

}  // namespace marble::nonlinear
