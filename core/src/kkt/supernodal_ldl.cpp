#include "kkt/supernodal_ldl.h"

#include <Eigen/Core>
#include <algorithm>
#include <tuple>

#include "kkt/blas.h"
#include "model/linear_algebra.h"
#include "model/tuning.h"

namespace marble {
namespace {

constexpr Index kNone = -1;
const double kOne = 1.0, kMinusOne = -1.0, kNothing = 0.0;  // BLAS needs their addresses

}  // namespace

SupernodalLdl::SupernodalLdl(const Elimination& elimination) {
  keep_blas_to_one_thread();
  group_columns(elimination);
  cut_into_blocks(elimination);
}

// A group absorbs the previous one if that is its child in the tree and few entries of the result are zero
// (Ashcraft and Grimes, "The influence of relaxed supernode partitions on the multifrontal method", 1989).
void SupernodalLdl::group_columns(const Elimination& elimination) {
  const auto below = [&](const Group& group) { return static_cast<double>(elimination.counts[group.last]); };
  for (Index column = 0; column < static_cast<Index>(elimination.parent.size()); ++column) {
    groups_.push_back({column, column, 0.0});
    while (groups_.size() > 1) {
      Group& before = groups_[groups_.size() - 2];
      const Group& last = groups_.back();
      const Index parent = elimination.parent[before.last];
      if (parent < last.first || parent > last.last) break;
      const double columns = last.last - before.first + 1.0;
      const double missing =
          (before.last - before.first + 1.0) * (last.last - before.last + below(last) - below(before));
      const double zeros = before.zeros + last.zeros + missing;
      const double entries = columns * (0.5 * (columns + 1.0) + below(last));
      if (zeros > tuning::supernode_zeros * entries) break;
      before = {before.first, last.last, zeros};
      groups_.pop_back();
    }
  }
}

void SupernodalLdl::cut_into_blocks(const Elimination& elimination) {
  block_of_.resize(elimination.parent.size());
  std::vector<Index> group_of(elimination.parent.size());
  std::int64_t rows = 0;
  std::int64_t values = 0;
  for (Index g = 0; g < static_cast<Index>(groups_.size()); ++g) {
    const auto [first, last, zeros] = groups_[g];
    const Index all_rows = last - first + 1 + elimination.counts[last];
    const Index parts = (last - first) / tuning::supernode_columns + 1;
    for (Index part = 0; part < parts; ++part) {
      const Index begin = first + (last - first + 1) * part / parts;
      const Index end = first + (last - first + 1) * (part + 1) / parts;
      std::fill(block_of_.begin() + begin, block_of_.begin() + end, static_cast<Index>(blocks_.size()));
      blocks_.push_back({begin, end - begin, all_rows - (begin - first), g, rows + begin - first, values});
      values += blocks_.back().size();
    }
    std::fill(group_of.begin() + first, group_of.begin() + last + 1, g);
    rows += all_rows;
    most_rows_ = std::max(most_rows_, all_rows);
  }
  for (const Group& group : groups_) {
    const Index parent = elimination.parent[group.last];
    group_parent_.push_back(parent == kNone ? kNone : group_of[parent]);
  }
}

double SupernodalLdl::bytes(const Pattern& matrix) const {
  if (blocks_.empty()) return 0.0;
  const Block& last = blocks_.back();
  return sizeof(double) *
             (static_cast<double>(last.values + last.size()) +
              static_cast<double>(tuning::supernode_columns) * (most_rows_ + tuning::supernode_columns)) +
         static_cast<double>(matrix.rows.size()) * sizeof(std::int64_t) +
         static_cast<double>(last.row_list + last.rows + matrix.size()) * sizeof(Index) +
         static_cast<double>(blocks_.size()) * (sizeof(Block) + 3.0 * sizeof(Index));
}

bool SupernodalLdl::allocate(const Pattern& matrix, const Interrupt& interrupt) {
  Checkpoint checkpoint(interrupt);
  const Block end = blocks_.empty() ? Block{} : blocks_.back();
  rows_.resize(static_cast<std::size_t>(end.row_list + end.rows));
  if (!find_rows(matrix, checkpoint)) return false;
  places_.resize(matrix.rows.size());
  for (Index column = 0; column < matrix.size(); ++column) {
    for (Index k = matrix.pointers[column]; k < matrix.pointers[column + 1]; ++k)
      places_[k] = place_of(column, matrix.rows[k]);
    if (checkpoint.reached(matrix.pointers[column + 1] - matrix.pointers[column])) return false;
  }
  values_ = LargeArray<double>(static_cast<std::size_t>(end.values + end.size()));
  scaled_ =
      LargeArray<double>(static_cast<std::size_t>(tuning::supernode_columns) * tuning::supernode_columns);
  product_ = LargeArray<double>(static_cast<std::size_t>(tuning::supernode_columns) * most_rows_);
  row_in_target_.resize(static_cast<std::size_t>(matrix.size()));
  for (auto* list : {&first_waiting_, &next_waiting_, &rows_done_}) list->resize(blocks_.size());
  return !interrupt.requested();
}

// A row of L has entries on the paths from the matrix's own entries up the tree, here from group to group.
bool SupernodalLdl::find_rows(const Pattern& matrix, Checkpoint& checkpoint) {
  std::vector<Index> seen(groups_.size(), kNone);
  std::vector<std::int64_t> next(groups_.size());
  for (const Block& block : blocks_) {
    const Group& group = groups_[block.group];
    if (block.first == group.first) next[block.group] = block.row_list;
  }
  for (Index row = 0; row < matrix.size(); ++row) {
    const Index own = blocks_[block_of_[row]].group;
    seen[own] = row;
    rows_[next[own]++] = row;
    for (Index k = matrix.pointers[row]; k < matrix.pointers[row + 1]; ++k) {
      for (Index g = blocks_[block_of_[matrix.rows[k]]].group; seen[g] != row; g = group_parent_[g]) {
        seen[g] = row;
        rows_[next[g]++] = row;
      }
    }
    if (checkpoint.reached(matrix.pointers[row + 1] - matrix.pointers[row])) return false;
  }
  return true;
}

std::int64_t SupernodalLdl::place_of(Index row, Index column) const {
  const Block& block = blocks_[block_of_[column]];
  const auto begin = rows_.begin() + block.row_list;
  const auto at = std::lower_bound(begin, begin + block.rows, row) - begin;
  return block.values + static_cast<std::int64_t>(column - block.first) * block.rows + at;
}

bool SupernodalLdl::load(const std::vector<double>& matrix_values, const Interrupt& interrupt) {
  Checkpoint checkpoint(interrupt);
  for (const Block& block : blocks_) {
    std::fill_n(values_.data() + block.values, block.size(), 0.0);
    if (checkpoint.reached(block.size())) return false;
  }
  for (std::size_t k = 0; k < places_.size(); ++k) values_[places_[k]] = matrix_values[k];
  return !checkpoint.reached(static_cast<std::int64_t>(places_.size()));
}

bool SupernodalLdl::factorize(const std::vector<double>& matrix_values, std::vector<double>& pivots,
                              const Interrupt& interrupt) {
  if (!load(matrix_values, interrupt)) return false;
  Checkpoint checkpoint(interrupt);
  std::fill(first_waiting_.begin(), first_waiting_.end(), kNone);
  for (Index number = 0; number < static_cast<Index>(blocks_.size()); ++number) {
    const Block& target = blocks_[number];
    const Index* const rows = rows_.data() + target.row_list;
    for (Index i = 0; i < target.rows; ++i) row_in_target_[rows[i]] = i;
    for (Index source = first_waiting_[number]; source != kNone;) {
      const Index next = next_waiting_[source];
      update(blocks_[source], target, pivots.data());
      if (checkpoint.reached(blocks_[source].size())) return false;
      source = next;
    }
    if (!eliminate(target, pivots.data())) return false;
    rows_done_[number] = target.columns;
    wait(number);
    if (checkpoint.reached(target.size())) return false;
  }
  return true;
}

void SupernodalLdl::wait(Index source) {
  const Block& block = blocks_[source];
  if (rows_done_[source] == block.rows) return;
  const Index target = block_of_[rows_[block.row_list + rows_done_[source]]];
  next_waiting_[source] = first_waiting_[target];
  first_waiting_[target] = source;
}

// target −= L D Lᵀ: the source's rows from the first one in the target's columns on, times those in its
// columns.
void SupernodalLdl::update(const Block& source, const Block& target, const double* pivots) {
  const auto number = static_cast<Index>(&source - blocks_.data());
  const Index* const rows = rows_.data() + source.row_list;
  const Index first = rows_done_[number];
  Index last = first;
  while (last < source.rows && rows[last] < target.end()) ++last;
  rows_done_[number] = last;
  wait(number);
  const int m = source.rows - first;
  const int n = last - first;
  const int k = source.columns;
  const double* const left = values_.data() + source.values + first;
  for (Index j = 0; j < n; ++j) {
    for (Index c = 0; c < k; ++c)
      scaled_[static_cast<std::ptrdiff_t>(j) * k + c] =
          pivots[source.first + c] * left[static_cast<std::ptrdiff_t>(c) * source.rows + j];
  }
  double* const out = values_.data() + target.values;
  const Index* const to = row_in_target_.data();
  const Index first_row = to[rows[first]];
  if (to[rows[source.rows - 1]] - first_row == m - 1) {  // the rows are contiguous in the target
    double* const block =
        out + static_cast<std::ptrdiff_t>(rows[first] - target.first) * target.rows + first_row;
    dgemm_("N", "N", &m, &n, &k, &kMinusOne, left, &source.rows, scaled_.data(), &k, &kOne, block,
           &target.rows);
    return;
  }
  dgemm_("N", "N", &m, &n, &k, &kOne, left, &source.rows, scaled_.data(), &k, &kNothing, product_.data(), &m);
  for (Index j = 0; j < n; ++j) {
    double* const column = out + static_cast<std::ptrdiff_t>(rows[first + j] - target.first) * target.rows;
    const double* const sums = product_.data() + static_cast<std::ptrdiff_t>(j) * m;
    for (Index i = j; i < m; ++i) column[to[rows[first + i]]] -= sums[i];
  }
}

// Computes LDLᵀ of the block's own rows, then the rows below them.
bool SupernodalLdl::eliminate(const Block& block, double* pivots) {
  double* const L = values_.data() + block.values;
  const int columns = block.columns;
  const int below = block.rows - columns;
  const auto column = [&](Index j) { return L + static_cast<std::ptrdiff_t>(j) * block.rows; };
  for (Index j = 0; j < columns; ++j) {
    double* const own = column(j);
    const double pivot = pivots[block.first + j] = own[j];
    if (pivot == 0.0) return false;
    for (Index k = j + 1; k < columns; ++k) {
      double* const other = column(k);
      const double factor = own[k] / pivot;
      for (Index i = k; i < columns; ++i) other[i] -= factor * own[i];
    }
    for (Index i = j + 1; i < columns; ++i) own[i] /= pivot;
  }
  if (below == 0) return true;
  dtrsm_("R", "L", "T", "U", &below, &columns, &kOne, L, &block.rows, L + columns, &block.rows);
  for (Index j = 0; j < columns; ++j) {
    const double inverse = 1.0 / pivots[block.first + j];
    double* const own = column(j);
    for (Index i = columns; i < block.rows; ++i) own[i] *= inverse;
  }
  return true;
}

bool SupernodalLdl::solve(double* x, Index first, const std::vector<double>& inverse_pivots,
                          const Interrupt& interrupt) const {
  using Matrix = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  Checkpoint checkpoint(interrupt);
  Eigen::Map<Vector> below(product_.data(), most_rows_);
  const auto parts = [&](const Block& block) {
    Matrix all(values_.data() + block.values, block.rows, block.columns, Eigen::OuterStride<>(block.rows));
    return std::tuple(all.topRows(block.columns).triangularView<Eigen::UnitLower>(),
                      all.bottomRows(block.rows - block.columns), below.head(block.rows - block.columns),
                      Eigen::Map<Vector>(x + block.first, block.columns));
  };
  for (auto block = blocks_.begin() + (block_of_.empty() ? 0 : block_of_[first]); block != blocks_.end();
       ++block) {
    auto [own, rest, sums, values] = parts(*block);
    if ((values.array() == 0.0).all()) continue;
    own.solveInPlace(values);
    sums.noalias() = rest * values;
    const Index* const rows = rows_.data() + block->row_list + block->columns;
    for (Index i = 0; i < sums.size(); ++i) x[rows[i]] -= sums[i];
    values.array() *= Eigen::Map<const Vector>(inverse_pivots.data() + block->first, block->columns).array();
    if (checkpoint.reached(block->size())) return false;
  }
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    auto [own, rest, known, values] = parts(*block);
    const Index* const rows = rows_.data() + block->row_list + block->columns;
    for (Index i = 0; i < known.size(); ++i) known[i] = x[rows[i]];
    values.noalias() -= rest.transpose() * known;
    own.transpose().solveInPlace(values);
    if (checkpoint.reached(block->size())) return false;
  }
  return true;
}

// Like solve(), on the transpose: the numbers of one row of L form a column.
bool SupernodalLdl::solve_many(double* x, int count, const std::vector<double>& inverse_pivots,
                               const Interrupt& interrupt) const {
  Checkpoint checkpoint(interrupt);
  double* const below = product_.data();
  const auto at = [x, count](Index row) { return x + static_cast<std::ptrdiff_t>(row) * count; };
  for (const Block& block : blocks_) {
    const double* const L = values_.data() + block.values;
    const int rest = block.rows - block.columns;
    double* const own = at(block.first);
    dtrsm_("R", "L", "T", "U", &count, &block.columns, &kOne, L, &block.rows, own, &count);
    if (rest > 0) {
      dgemm_("N", "T", &count, &rest, &block.columns, &kOne, own, &count, L + block.columns, &block.rows,
             &kNothing, below, &count);
      const Index* const rows = rows_.data() + block.row_list + block.columns;
      for (Index i = 0; i < rest; ++i) {
        double* const to = at(rows[i]);
        for (Index k = 0; k < count; ++k) to[k] -= below[i * count + k];
      }
    }
    for (Index j = 0; j < block.columns; ++j) {
      for (Index k = 0; k < count; ++k) own[j * count + k] *= inverse_pivots[block.first + j];
    }
    if (checkpoint.reached(block.size() * count)) return false;
  }
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    const double* const L = values_.data() + block->values;
    const int rest = block->rows - block->columns;
    double* const own = at(block->first);
    if (rest > 0) {
      const Index* const rows = rows_.data() + block->row_list + block->columns;
      for (Index i = 0; i < rest; ++i) std::copy_n(at(rows[i]), count, below + i * count);
      dgemm_("N", "N", &count, &block->columns, &rest, &kMinusOne, below, &count, L + block->columns,
             &block->rows, &kOne, own, &count);
    }
    dtrsm_("R", "L", "N", "U", &count, &block->columns, &kOne, L, &block->rows, own, &count);
    if (checkpoint.reached(block->size() * count)) return false;
  }
  return true;
}

}  // namespace marble
