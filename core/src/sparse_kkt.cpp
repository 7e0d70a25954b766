#include "sparse_kkt.h"

#include <amd.h>
extern "C" {  // ldl.h forgets to say so
#include <ldl.h>
}

#include <algorithm>
#include <cmath>
#include <numeric>

namespace marble {
namespace {

// A kept row with weight 0 must drop out: −1/k would be infinite, this decouples it to rounding.
constexpr double kSmallestWeight = 1e-20;

double minus_inverse(double weight) {
  return -1.0 / (std::abs(weight) < kSmallestWeight ? kSmallestWeight : weight);
}

bool is_kept(KeptRows kept, Index length, Index variables) {
  return kept == KeptRows::all || (kept == KeptRows::dense && length > std::max<Index>(16, variables / 8));
}

// Collects the coordinates of the upper triangle and tells each term's position in the compressed pattern.
class PatternBuilder {
 public:
  explicit PatternBuilder(Index size) : columns_(static_cast<std::size_t>(size)) {}
  void add(Index a, Index b) { columns_[std::max(a, b)].push_back(std::min(a, b)); }

  void compress() {
    pointers.assign(1, 0);
    for (std::vector<Index>& column : columns_) {
      std::sort(column.begin(), column.end());
      column.erase(std::unique(column.begin(), column.end()), column.end());
      rows.insert(rows.end(), column.begin(), column.end());
      pointers.push_back(static_cast<Index>(rows.size()));
    }
  }
  [[nodiscard]] Index slot(Index a, Index b) const {
    const Index column = std::max(a, b);
    const auto begin = rows.begin() + pointers[column];
    const auto end = rows.begin() + pointers[column + 1];
    return static_cast<Index>(std::lower_bound(begin, end, std::min(a, b)) - rows.begin());
  }

  std::vector<Index> pointers, rows;

 private:
  std::vector<std::vector<Index>> columns_;
};

}  // namespace

SparseKkt::SparseKkt(const ScaledProblem& problem, KeptRows kept)
    : kept_(kept), variables_(problem.variables()), equalities_(problem.equalities()) {
  gather_rows(problem, kept);
  build_pattern(problem);
}

// A condensed row brings a coordinate and a slot for each pair of its columns.
double SparseKkt::analysis_bytes(const ScaledProblem& problem, KeptRows kept) {
  double coordinates = static_cast<double>(problem.Q.values.size() + problem.A.values.size());
  for (const RowMatrix* matrix : {&problem.C, &problem.L, &problem.R}) {
    for (Index row = 0; row < matrix->rows; ++row) {
      const double length = matrix->row_size(row);
      coordinates +=
          is_kept(kept, matrix->row_size(row), problem.variables()) ? length : 0.5 * length * (length + 1.0);
    }
  }
  return 4.0 * sizeof(Index) * coordinates;
}

void SparseKkt::allocate(const ScaledProblem& problem) {
  const auto size = static_cast<std::size_t>(size_);
  const auto entries = static_cast<std::size_t>(factor_pointers_.back());
  constant_.assign(row_indices_.size(), 0.0);
  values_.resize(row_indices_.size());
  factor_rows_.resize(entries);
  factor_values_.resize(entries);
  pivots_.resize(size);
  inverse_pivots_.resize(size);
  dense_row_.assign(size, 0.0);
  next_.resize(size);
  find_row_patterns();
  right_side_.resize(size_);
  solution_.resize(size_);
  residual_.resize(size_);
  load(problem);
}

void SparseKkt::gather_rows(const ScaledProblem& problem, KeptRows kept) {
  const auto keep = [&](std::size_t length) { return is_kept(kept, static_cast<Index>(length), variables_); };
  inequality_rows_.resize(problem.inequalities());
  for (Index i = 0; i < problem.inequalities(); ++i) {
    Row& row = inequality_rows_[i];
    const auto begin = problem.C.row_pointers[i];
    const auto end = problem.C.row_pointers[i + 1];
    row.columns.assign(problem.C.column_indices.begin() + begin, problem.C.column_indices.begin() + end);
    row.values.resize(row.columns.size());
    row.kept = keep(row.columns.size());
  }
  pair_rows_.resize(problem.pairs());
  for (Index i = 0; i < problem.pairs(); ++i) {
    Row& row = pair_rows_[i];
    Index p = problem.L.row_pointers[i];
    Index q = problem.R.row_pointers[i];
    const Index p_end = problem.L.row_pointers[i + 1];
    const Index q_end = problem.R.row_pointers[i + 1];
    while (p < p_end || q < q_end) {
      const Index left = p < p_end ? problem.L.column_indices[p] : variables_;
      const Index right = q < q_end ? problem.R.column_indices[q] : variables_;
      row.columns.push_back(std::min(left, right));
      if (left <= right) ++p;
      if (right <= left) ++q;
    }
    row.values.resize(row.columns.size());
    row.second_values.resize(row.columns.size());
    row.kept = keep(row.columns.size());
  }
}

void SparseKkt::build_pattern(const ScaledProblem& problem) {
  const Index n = variables_;
  size_ = n + equalities_;
  std::vector<Index> first_kept;  // number of the (first) own row of each kept constraint, in row order
  for (const Row& row : inequality_rows_) {
    first_kept.push_back(size_);
    if (row.kept) size_ += 1;
  }
  for (const Row& row : pair_rows_) {
    first_kept.push_back(size_);
    if (row.kept) size_ += 2;
  }

  PatternBuilder pattern(size_);
  const auto visit_constants = [&](auto&& visit) {
    for (Index column = 0; column < n; ++column) {
      for (Index k = problem.Q.column_pointers[column]; k < problem.Q.column_pointers[column + 1]; ++k) {
        visit(problem.Q.row_indices[k], column);
      }
    }
    for (Index row = 0; row < equalities_; ++row) {
      for (Index k = problem.A.row_pointers[row]; k < problem.A.row_pointers[row + 1]; ++k) {
        visit(problem.A.column_indices[k], n + row);
      }
    }
  };
  const auto visit_row = [&](Row& row, Index own, auto&& visit) {
    const std::size_t length = row.columns.size();
    if (row.kept) {
      for (std::size_t k = 0; k < length; ++k) visit(row.columns[k], own, row.slots);
      if (!row.second_values.empty()) {
        for (std::size_t k = 0; k < length; ++k) visit(row.columns[k], own + 1, row.second_slots);
      }
    } else {
      for (std::size_t a = 0; a < length; ++a) {
        for (std::size_t b = 0; b <= a; ++b) visit(row.columns[a], row.columns[b], row.slots);
      }
    }
  };
  const auto visit_rows = [&](auto&& visit) {
    std::size_t number = 0;
    for (Row& row : inequality_rows_) visit_row(row, first_kept[number++], visit);
    for (Row& row : pair_rows_) visit_row(row, first_kept[number++], visit);
  };

  for (Index i = 0; i < size_; ++i) pattern.add(i, i);
  visit_constants([&](Index a, Index b) { pattern.add(a, b); });
  visit_rows([&](Index a, Index b, std::vector<Index>&) { pattern.add(a, b); });
  pattern.compress();
  order_and_analyse(pattern.pointers, pattern.rows);

  // From the pattern's slots to those of the permuted matrix.
  std::vector<Index> moved(pattern.rows.size());
  std::vector<Index> next = column_pointers_;
  row_indices_.resize(pattern.rows.size());
  for (Index column = 0; column < size_; ++column) {
    for (Index k = pattern.pointers[column]; k < pattern.pointers[column + 1]; ++k) {
      const Index a = inverse_permutation_[pattern.rows[k]];
      const Index b = inverse_permutation_[column];
      moved[k] = next[std::max(a, b)]++;
      row_indices_[moved[k]] = std::min(a, b);
    }
  }
  const auto slot = [&](Index a, Index b) { return moved[pattern.slot(a, b)]; };

  visit_constants([&](Index a, Index b) { constant_slots_.push_back(slot(a, b)); });
  visit_rows([&](Index a, Index b, std::vector<Index>& slots) { slots.push_back(slot(a, b)); });
  for (Index i = 0; i < n + equalities_; ++i) diagonal_slots_.push_back(slot(i, i));
  std::size_t number = 0;
  for (Row& row : inequality_rows_) {
    const Index own = first_kept[number++];
    if (row.kept) row.diagonal = slot(own, own);
  }
  for (Row& row : pair_rows_) {
    const Index own = first_kept[number++];
    if (!row.kept) continue;
    row.diagonal = slot(own, own);
    row.second_diagonal = slot(own + 1, own + 1);
  }
}

void SparseKkt::load(const ScaledProblem& problem) {
  std::fill(constant_.begin(), constant_.end(), 0.0);
  auto slot = constant_slots_.begin();
  for (const auto* values : {&problem.Q.values, &problem.A.values}) {
    for (const double value : *values) constant_[*slot++] += value;
  }
  for (Index i = 0; i < problem.inequalities(); ++i) {
    const auto begin = problem.C.values.begin() + problem.C.row_pointers[i];
    std::copy_n(begin, problem.C.row_size(i), inequality_rows_[i].values.begin());
  }
  const auto spread = [](const RowMatrix& matrix, Index i, const Row& row, std::vector<double>& values) {
    Index k = matrix.row_pointers[i];
    for (std::size_t at = 0; at < values.size(); ++at) {
      const bool here = k < matrix.row_pointers[i + 1] && matrix.column_indices[k] == row.columns[at];
      values[at] = here ? matrix.values[k++] : 0.0;
    }
  };
  for (Index i = 0; i < problem.pairs(); ++i) {
    spread(problem.L, i, pair_rows_[i], pair_rows_[i].values);
    spread(problem.R, i, pair_rows_[i], pair_rows_[i].second_values);
  }
}

void SparseKkt::order_and_analyse(const std::vector<Index>& columns, const std::vector<Index>& rows) {
  const auto size = static_cast<std::size_t>(size_);
  permutation_.resize(size);
  inverse_permutation_.resize(size);
  if (amd_order(size_, columns.data(), rows.data(), permutation_.data(), nullptr, nullptr) < AMD_OK) {
    std::iota(permutation_.begin(), permutation_.end(), 0);
  }
  for (Index i = 0; i < size_; ++i) inverse_permutation_[permutation_[i]] = i;

  column_pointers_.assign(size + 1, 0);
  for (Index column = 0; column < size_; ++column) {
    for (Index k = columns[column]; k < columns[column + 1]; ++k) {
      ++column_pointers_[std::max(inverse_permutation_[rows[k]], inverse_permutation_[column]) + 1];
    }
  }
  std::partial_sum(column_pointers_.begin(), column_pointers_.end(), column_pointers_.begin());

  // The elimination tree needs the permuted row indices; their order within a column does not matter to LDL.
  std::vector<Index> permuted_rows(rows.size());
  std::vector<Index> next = column_pointers_;
  for (Index column = 0; column < size_; ++column) {
    for (Index k = columns[column]; k < columns[column + 1]; ++k) {
      const Index a = inverse_permutation_[rows[k]];
      const Index b = inverse_permutation_[column];
      permuted_rows[next[std::max(a, b)]++] = std::min(a, b);
    }
  }
  factor_pointers_.resize(size + 1);
  parent_.resize(size);
  factor_counts_.resize(size);
  flag_.resize(size);
  ldl_symbolic(size_, column_pointers_.data(), permuted_rows.data(), factor_pointers_.data(), parent_.data(),
               factor_counts_.data(), flag_.data(), nullptr, nullptr);
  flops_ = static_cast<double>(rows.size());
  for (const Index count : factor_counts_) flops_ += static_cast<double>(count) * (count + 2.0);
  for (const auto* group : {&inequality_rows_, &pair_rows_}) {
    for (const Row& row : *group) {
      const auto length = static_cast<double>(row.columns.size());
      flops_ += row.kept ? 2.0 * length : length * (length + 1.0);
    }
  }
}

// Row k of L has entries where the paths from its columns to k in the elimination tree lead (Davis, "Direct
// Methods for Sparse Linear Systems", 2006, section 4.2). The same at every factorization: found once.
void SparseKkt::find_row_patterns() {
  row_patterns_.reserve(factor_rows_.size());
  row_pattern_pointers_.assign(1, 0);
  std::fill(flag_.begin(), flag_.end(), -1);
  std::copy(factor_pointers_.begin(), factor_pointers_.end() - 1, next_.begin());
  for (Index k = 0; k < size_; ++k) {
    flag_[k] = k;
    const auto begin = static_cast<std::ptrdiff_t>(row_patterns_.size());
    for (Index at = column_pointers_[k]; at < column_pointers_[k + 1]; ++at) {
      for (Index i = row_indices_[at]; flag_[i] != k; i = parent_[i]) {
        row_patterns_.push_back(i);
        flag_[i] = k;
      }
    }
    std::sort(row_patterns_.begin() + begin, row_patterns_.end());
    row_pattern_pointers_.push_back(static_cast<Index>(row_patterns_.size()));
    for (auto i = row_patterns_.begin() + begin; i != row_patterns_.end(); ++i) factor_rows_[next_[*i]++] = k;
  }
}

// Up-looking LDLᵀ, as in SuiteSparse's LDL but with the patterns at hand. False at a pivot that is 0.
bool SparseKkt::factorize() {
  std::copy(factor_pointers_.begin(), factor_pointers_.end() - 1, next_.begin());
  double* const row = dense_row_.data();
  for (Index k = 0; k < size_; ++k) {
    double pivot = 0.0;
    for (Index at = column_pointers_[k]; at < column_pointers_[k + 1]; ++at) {
      const Index i = row_indices_[at];
      if (i == k) {
        pivot = values_[at];
      } else {
        row[i] = values_[at];
      }
    }
    for (Index at = row_pattern_pointers_[k]; at < row_pattern_pointers_[k + 1]; ++at) {
      const Index i = row_patterns_[at];
      const double entry = row[i];
      row[i] = 0.0;
      const Index end = next_[i];
      for (Index p = factor_pointers_[i]; p < end; ++p) row[factor_rows_[p]] -= factor_values_[p] * entry;
      const double scaled = entry * inverse_pivots_[i];
      pivot -= scaled * entry;
      factor_values_[end] = scaled;
      next_[i] = end + 1;
    }
    if (pivot == 0.0) return false;
    pivots_[k] = pivot;
    inverse_pivots_[k] = 1.0 / pivot;
  }
  return true;
}

void SparseKkt::add_condensed(const Row& row, double left_left, double left_right, double right_right) {
  std::size_t k = 0;
  const std::size_t length = row.columns.size();
  if (row.second_values.empty()) {
    for (std::size_t a = 0; a < length; ++a) {
      const double weighted = left_left * row.values[a];
      for (std::size_t b = 0; b <= a; ++b) values_[row.slots[k++]] += weighted * row.values[b];
    }
    return;
  }
  for (std::size_t a = 0; a < length; ++a) {
    const double on_left = left_left * row.values[a] + left_right * row.second_values[a];
    const double on_right = left_right * row.values[a] + right_right * row.second_values[a];
    for (std::size_t b = 0; b <= a; ++b) {
      values_[row.slots[k++]] += on_left * row.values[b] + on_right * row.second_values[b];
    }
  }
}

void SparseKkt::assemble(const RowWeights& weights) {
  values_ = constant_;
  for (Index i = 0; i < variables_; ++i) values_[diagonal_slots_[i]] += weights.delta;
  for (Index i = 0; i < equalities_; ++i) values_[diagonal_slots_[variables_ + i]] = -1.0 / weights.rho;
  for (std::size_t i = 0; i < inequality_rows_.size(); ++i) {
    const Row& row = inequality_rows_[i];
    const double weight = weights.inequality[static_cast<Index>(i)];
    if (!row.kept) {
      if (weight != 0.0) add_condensed(row, weight, 0.0, 0.0);
      continue;
    }
    for (std::size_t k = 0; k < row.slots.size(); ++k) values_[row.slots[k]] = row.values[k];
    values_[row.diagonal] = minus_inverse(weight);
  }
  for (std::size_t i = 0; i < pair_rows_.size(); ++i) {
    const Row& row = pair_rows_[i];
    const auto index = static_cast<Index>(i);
    const double c = weights.cosine[index];
    const double s = weights.sine[index];
    const double first = weights.first[index];
    const double second = weights.second[index];
    if (!row.kept) {
      add_condensed(row, first * c * c + second * s * s, (first - second) * c * s,
                    first * s * s + second * c * c);
      continue;
    }
    for (std::size_t k = 0; k < row.slots.size(); ++k) {
      values_[row.slots[k]] = c * row.values[k] + s * row.second_values[k];
      values_[row.second_slots[k]] = s * row.values[k] - c * row.second_values[k];
    }
    values_[row.diagonal] = minus_inverse(first);
    values_[row.second_diagonal] = minus_inverse(second);
  }
}

Index SparseKkt::kept_negative_weights(const RowWeights& weights) const {
  const auto negative = [](double weight) { return weight <= -kSmallestWeight ? 1 : 0; };
  Index count = 0;
  for (std::size_t i = 0; i < pair_rows_.size(); ++i) {
    if (!pair_rows_[i].kept) continue;
    count += negative(weights.first[static_cast<Index>(i)]) + negative(weights.second[static_cast<Index>(i)]);
  }
  return count;
}

bool SparseKkt::factor(const RowWeights& weights) {
  assemble(weights);
  if (!factorize()) return false;
  // Haynsworth: a kept row with k > 0 asks for a negative pivot, one with k < 0 for a positive one.
  const auto positive =
      static_cast<Index>(std::count_if(pivots_.begin(), pivots_.end(), [](double d) { return d > 0.0; }));
  return positive == variables_ + kept_negative_weights(weights);
}

void SparseKkt::back_substitute(double* out, Index first) const {
  const Index* const pointers = factor_pointers_.data();
  const Index* const rows = factor_rows_.data();
  const double* const factor = factor_values_.data();
  for (Index j = first; j < size_; ++j) {
    const double entry = out[j];
    if (entry == 0.0) continue;
    for (Index k = pointers[j]; k < pointers[j + 1]; ++k) out[rows[k]] -= factor[k] * entry;
    out[j] = entry * inverse_pivots_[j];
  }
  for (Index j = size_ - 1; j >= 0; --j) {
    double even = out[j];  // two sums: one would wait for itself
    double odd = 0.0;
    Index k = pointers[j];
    const Index end = pointers[j + 1];
    for (; k + 1 < end; k += 2) {
      even -= factor[k] * out[rows[k]];
      odd += factor[k + 1] * out[rows[k + 1]];
    }
    if (k < end) even -= factor[k] * out[rows[k]];
    out[j] = even - odd;
  }
}

// Most of the forward substitution has nothing to do.
void SparseKkt::solve_sparse(std::span<const Index> indices, std::span<const double> values, VectorRef x) {
  double* const out = solution_.data();
  solution_.setZero();
  Index first = size_;
  for (std::size_t k = 0; k < indices.size(); ++k) {
    const Index at = inverse_permutation_[indices[k]];
    out[at] = values[k];
    first = std::min(first, at);
  }
  back_substitute(out, first);
  for (Index i = 0; i < variables_; ++i) x[i] = out[inverse_permutation_[i]];
}

void SparseKkt::solve(VectorRef x, VectorRef y) {
  right_side_.setZero();
  for (Index i = 0; i < variables_; ++i) right_side_[inverse_permutation_[i]] = x[i];
  for (Index i = 0; i < equalities_; ++i) right_side_[inverse_permutation_[variables_ + i]] = y[i];
  solution_ = right_side_;
  back_substitute(solution_.data(), 0);

  residual_ = right_side_;
  for (Index column = 0; column < size_; ++column) {
    double sum = 0.0;
    for (Index k = column_pointers_[column]; k < column_pointers_[column + 1]; ++k) {
      const Index row = row_indices_[k];
      sum += values_[k] * solution_[row];
      if (row != column) residual_[row] -= values_[k] * solution_[column];
    }
    residual_[column] -= sum;
  }
  back_substitute(residual_.data(), 0);
  solution_ += residual_;

  for (Index i = 0; i < variables_; ++i) x[i] = solution_[inverse_permutation_[i]];
  for (Index i = 0; i < equalities_; ++i) y[i] = solution_[inverse_permutation_[variables_ + i]];
}

std::string_view SparseKkt::name() const {
  switch (kept_) {
    case KeptRows::none:
      return "sparse condensed";
    case KeptRows::dense:
      return "sparse, dense rows kept";
    case KeptRows::all:
      break;
  }
  return "sparse full";
}

double SparseKkt::bytes() const {
  double slots = static_cast<double>(constant_slots_.size());
  double row_entries = 0.0;
  for (const auto* group : {&inequality_rows_, &pair_rows_}) {
    for (const Row& row : *group) {
      slots += static_cast<double>(row.slots.size() + row.second_slots.size());
      row_entries += static_cast<double>(row.columns.size());
    }
  }
  const double factor_entries = factor_pointers_.back();
  const auto pattern_entries = static_cast<double>(row_indices_.size());
  return factor_entries * (sizeof(double) + 2.0 * sizeof(Index)) +
         pattern_entries * (2.0 * sizeof(double) + sizeof(Index)) + slots * sizeof(Index) +
         row_entries * (2.0 * sizeof(double) + sizeof(Index)) +
         static_cast<double>(inequality_rows_.size() + pair_rows_.size()) * sizeof(Row) +
         size_ * (6.0 * sizeof(double) + 9.0 * sizeof(Index));
}

}  // namespace marble
