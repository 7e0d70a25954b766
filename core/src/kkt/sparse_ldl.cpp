#include "kkt/sparse_ldl.h"

#include <algorithm>
#include <numeric>

#include "model/tuning.h"

namespace marble {

bool SparseLdl::analyse(const Pattern& pattern, const Interrupt& interrupt) {
  std::vector<Index> permutation;
  if (!order(pattern, interrupt, permutation)) return false;
  permute(pattern, permutation);
  if (!marble::analyse(matrix_, interrupt, elimination_)) return false;
  if (elimination_.flops <= tuning::filled_in * elimination_.entries) return true;
  std::vector<Index> in_postorder = postorder(elimination_.parent);
  for (Index& column : in_postorder) column = permutation[column];
  permute(pattern, in_postorder);
  if (!marble::analyse(matrix_, interrupt, elimination_)) return false;
  blocks_.emplace(elimination_);
  return true;
}

void SparseLdl::permute(const Pattern& pattern, const std::vector<Index>& permutation) {
  const Index n = pattern.size();
  inverse_permutation_.resize(permutation.size());
  for (Index i = 0; i < n; ++i) inverse_permutation_[permutation[i]] = i;

  const auto visit = [&](auto&& entry) {
    for (Index column = 0; column < n; ++column) {
      const Index b = inverse_permutation_[column];
      for (Index k = pattern.pointers[column]; k < pattern.pointers[column + 1]; ++k) {
        const Index a = inverse_permutation_[pattern.rows[k]];
        entry(k, std::min(a, b), std::max(a, b));
      }
    }
  };
  matrix_.pointers.assign(permutation.size() + 1, 0);
  visit([this](Index, Index, Index column) { ++matrix_.pointers[column + 1]; });
  std::partial_sum(matrix_.pointers.begin(), matrix_.pointers.end(), matrix_.pointers.begin());
  matrix_.rows.resize(pattern.rows.size());
  places_.resize(pattern.rows.size());
  std::vector<Index> next = matrix_.pointers;
  visit([&](Index k, Index row, Index column) {
    places_[k] = next[column]++;
    matrix_.rows[places_[k]] = row;
  });
}

double SparseLdl::flops() const {
  return blocks_ ? elimination_.flops / tuning::dense_advantage + tuning::supernode_cost * blocks_->count()
                 : elimination_.flops;
}

double SparseLdl::bytes() const {
  if (blocks_)
    return blocks_->bytes(matrix_) + static_cast<double>(matrix_.rows.size()) * sizeof(Index) +
           size() * (2.0 * sizeof(double) + 4.0 * sizeof(Index));
  return elimination_.entries * (sizeof(double) + 2.0 * sizeof(Index)) +
         static_cast<double>(matrix_.rows.size()) * sizeof(Index) +
         size() * (3.0 * sizeof(double) + 3.0 * sizeof(std::int64_t) + 4.0 * sizeof(Index));
}

bool SparseLdl::allocate(const Interrupt& interrupt) {
  const auto n = static_cast<std::size_t>(size());
  pivots_.resize(n);
  inverse_pivots_.resize(n);
  if (blocks_) return blocks_->allocate(matrix_, interrupt);
  pointers_.assign(n + 1, 0);
  std::inclusive_scan(elimination_.counts.begin(), elimination_.counts.end(), pointers_.begin() + 1,
                      std::plus<>(), std::int64_t{0});
  longest_ = n == 0 ? 0 : *std::max_element(elimination_.counts.begin(), elimination_.counts.end());
  const auto entries = static_cast<std::size_t>(pointers_.back());
  rows_ = LargeArray<Index>(entries);
  columns_ = LargeArray<Index>(entries);
  values_ = LargeArray<double>(entries);
  dense_row_.assign(n, 0.0);
  next_.resize(n);
  return find_patterns(interrupt);
}

// Row k of L has entries on the paths from its columns to k in the elimination tree (Davis, "Direct Methods
// for Sparse Linear Systems", 2006, section 4.2). They are the same in every factorization, so they are found
// once.
bool SparseLdl::find_patterns(const Interrupt& interrupt) {
  Checkpoint checkpoint(interrupt);
  std::vector<Index> flag(next_.size(), -1);
  row_pointers_.assign(1, 0);
  row_pointers_.reserve(next_.size() + 1);
  std::copy(pointers_.begin(), pointers_.end() - 1, next_.begin());
  Index* end = columns_.data();
  for (Index k = 0; k < size(); ++k) {
    flag[k] = k;
    Index* const begin = end;
    for (Index at = matrix_.pointers[k]; at < matrix_.pointers[k + 1]; ++at) {
      for (Index i = matrix_.rows[at]; flag[i] != k; i = elimination_.parent[i]) {
        *end++ = i;
        flag[i] = k;
      }
    }
    std::sort(begin, end);
    row_pointers_.push_back(end - columns_.data());
    for (const Index* i = begin; i != end; ++i) rows_[next_[*i]++] = k;
    if (checkpoint.reached(8 * (end - begin))) return false;
  }
  return true;
}

// Continues to entry `last` of the rows' patterns, or to the end. Returns false at a pivot that is 0. Kept
// out of the surrounding loop: the check of the clock there would take its registers and a fifth of its
// speed.
[[gnu::noinline]] bool SparseLdl::eliminate(const double* matrix_values, Place& place, std::int64_t last) {
  const std::int64_t* const pointers = pointers_.data();
  const Index* const rows = rows_.data();
  const Index* const columns = columns_.data();
  std::int64_t* const next = next_.data();
  double* const values = values_.data();
  double* const row = dense_row_.data();
  auto [k, at, pivot] = place;
  for (const Index n = size(); k < n; ++k) {
    if (at == row_pointers_[k]) {  // the row has not started
      next[k] = pointers[k];
      pivot = 0.0;
      for (Index entry = matrix_.pointers[k]; entry < matrix_.pointers[k + 1]; ++entry) {
        const Index i = matrix_.rows[entry];
        if (i == k) {
          pivot = matrix_values[entry];
        } else {
          row[i] = matrix_values[entry];
        }
      }
    }
    const std::int64_t row_end = row_pointers_[k + 1];
    for (const std::int64_t stop = std::min(last, row_end); at < stop; ++at) {
      const Index i = columns[at];
      const double entry = row[i];
      row[i] = 0.0;
      const std::int64_t end = next[i];
      for (std::int64_t p = pointers[i]; p < end; ++p) row[rows[p]] -= values[p] * entry;
      const double scaled = entry * inverse_pivots_[i];
      pivot -= scaled * entry;
      values[end] = scaled;
      next[i] = end + 1;
    }
    if (at < row_end) break;
    if (pivot == 0.0) return false;
    pivots_[k] = pivot;
    inverse_pivots_[k] = 1.0 / pivot;
  }
  place = {k, at, pivot};
  return true;
}

// Up-looking, as in SuiteSparse's LDL, but with precomputed patterns.
bool SparseLdl::factorize(const std::vector<double>& matrix_values, const Interrupt& interrupt) {
  if (blocks_) {
    if (!blocks_->factorize(matrix_values, pivots_, interrupt)) return false;
    std::transform(pivots_.begin(), pivots_.end(), inverse_pivots_.begin(), [](double d) { return 1.0 / d; });
    return true;
  }
  const std::int64_t between_looks =
      std::max<std::int64_t>(1, tuning::entries_between_looks / (longest_ + 1));
  Place place;
  while (eliminate(matrix_values.data(), place, place.at + between_looks)) {
    if (place.row == size()) return true;
    if (interrupt.requested()) break;
  }
  std::fill(dense_row_.begin(), dense_row_.end(), 0.0);
  return false;
}

Index SparseLdl::positive_pivots() const {
  return static_cast<Index>(std::count_if(pivots_.begin(), pivots_.end(), [](double d) { return d > 0.0; }));
}

template <class T>
bool SparseLdl::solve(T* x, Index first, const Interrupt& interrupt) const {
  if (blocks_) {
    if constexpr (lanes_of<T> == 1) {
      return blocks_->solve(x, first, inverse_pivots_, interrupt);
    } else {
      return blocks_->solve_many(reinterpret_cast<double*>(x), lanes_of<T>, inverse_pivots_, interrupt);
    }
  }
  Checkpoint checkpoint(interrupt);
  const std::int64_t* const pointers = pointers_.data();
  const Index* const rows = rows_.data();
  const double* const values = values_.data();
  for (Index begin = first; begin < size(); begin += tuning::block_columns) {
    const Index end = std::min(begin + tuning::block_columns, size());
    for (Index j = begin; j < end; ++j) {
      const T entry = x[j];
      if (is_zero(entry)) continue;
      for (std::int64_t k = pointers[j]; k < pointers[j + 1]; ++k) x[rows[k]] -= values[k] * entry;
      x[j] = inverse_pivots_[j] * entry;
    }
    if (checkpoint.reached(entries_of(begin, end))) return false;
  }
  for (Index end = size(); end > 0; end -= tuning::block_columns) {
    const Index begin = std::max<Index>(0, end - tuning::block_columns);
    for (Index j = end - 1; j >= begin; --j) {
      T even = x[j];  // two sums, because a single one would wait for itself
      T odd{};
      std::int64_t k = pointers[j];
      const std::int64_t last = pointers[j + 1];
      for (; k + 1 < last; k += 2) {
        even -= values[k] * x[rows[k]];
        odd += values[k + 1] * x[rows[k + 1]];
      }
      if (k < last) even -= values[k] * x[rows[k]];
      x[j] = even - odd;
    }
    if (checkpoint.reached(entries_of(begin, end))) return false;
  }
  return true;
}

template bool SparseLdl::solve(double*, Index, const Interrupt&) const;
template bool SparseLdl::solve(Lanes<2>*, Index, const Interrupt&) const;
template bool SparseLdl::solve(Lanes<4>*, Index, const Interrupt&) const;
template bool SparseLdl::solve(Lanes<8>*, Index, const Interrupt&) const;

}  // namespace marble
