#include "kkt/sparse_kkt.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"

namespace marble {
namespace {

// A kept row with weight 0 must have no effect. −1/k would be infinite; this value decouples it to rounding.
double minus_inverse(double weight) {
  return -1.0 / (std::abs(weight) < tuning::roundoff ? tuning::roundoff : weight);
}

bool is_kept(KeptRows kept, Index length, Index variables) {
  return kept == KeptRows::all || (kept == KeptRows::dense && SparseKkt::is_long_row(length, variables));
}

// Collects the coordinates of the upper triangle and returns each term's position in the compressed pattern.
class PatternBuilder {
 public:
  explicit PatternBuilder(Index size) : columns_(static_cast<std::size_t>(size)) {}
  void add(Index a, Index b) { columns_[std::max(a, b)].push_back(std::min(a, b)); }

  void compress(Checkpoint& checkpoint) {
    pattern.pointers.assign(1, 0);
    for (std::vector<Index>& column : columns_) {
      if (checkpoint.reached(static_cast<std::int64_t>(column.size()))) return;
      std::sort(column.begin(), column.end());
      column.erase(std::unique(column.begin(), column.end()), column.end());
      pattern.rows.insert(pattern.rows.end(), column.begin(), column.end());
      pattern.pointers.push_back(static_cast<Index>(pattern.rows.size()));
    }
  }
  [[nodiscard]] Index slot(Index a, Index b) const {
    const Index column = std::max(a, b);
    const auto begin = pattern.rows.begin() + pattern.pointers[column];
    const auto end = pattern.rows.begin() + pattern.pointers[column + 1];
    return static_cast<Index>(std::lower_bound(begin, end, std::min(a, b)) - pattern.rows.begin());
  }

  Pattern pattern;

 private:
  std::vector<std::vector<Index>> columns_;
};

}  // namespace

SparseKkt::SparseKkt(const ScaledProblem& problem, KeptRows kept)
    : kept_(kept), variables_(problem.variables()), equalities_(problem.equalities()) {
  gather_rows(problem, kept);
}

std::unique_ptr<SparseKkt> SparseKkt::analyse(const ScaledProblem& problem, KeptRows kept,
                                              const Interrupt& interrupt) {
  std::unique_ptr<SparseKkt> kkt(new SparseKkt(problem, kept));
  kkt->attend(interrupt);
  return kkt->build_pattern(problem) ? std::move(kkt) : nullptr;
}

bool SparseKkt::is_long_row(Index length, Index variables) {
  return length > std::max(static_cast<double>(tuning::tiny), variables / tuning::dense_advantage);
}

// A condensed row needs a coordinate and a slot for each pair of its columns.
double SparseKkt::analysis_bytes(const ScaledProblem& problem, KeptRows kept) {
  double coordinates = static_cast<double>(problem.Q.values.size() + problem.A.values.size());
  for (Index row = 0; row < problem.rows.rows; ++row) {
    const double length = problem.rows.row_size(row);
    coordinates += is_kept(kept, problem.rows.row_size(row), problem.variables())
                       ? length
                       : 0.5 * length * (length + 1.0);
  }
  return 4.0 * sizeof(Index) * coordinates;
}

bool SparseKkt::allocate(const ScaledProblem& problem) {
  constant_.assign(ldl_.matrix().rows.size(), 0.0);
  values_.resize(constant_.size());
  if (!ldl_.allocate(interrupt())) return false;
  right_side_.resize(size_);
  solution_.resize(size_);
  residual_.resize(size_);
  load(problem);
  return true;
}

void SparseKkt::gather_rows(const ScaledProblem& problem, KeptRows kept) {
  const auto keep = [&](std::size_t length) { return is_kept(kept, static_cast<Index>(length), variables_); };
  inequality_rows_.resize(problem.inequalities());
  for (Index i = 0; i < problem.inequalities(); ++i) {
    Row& row = inequality_rows_[i];
    const auto begin = problem.rows.row_pointers[i];
    const auto end = problem.rows.row_pointers[i + 1];
    row.columns.assign(problem.rows.column_indices.begin() + begin,
                       problem.rows.column_indices.begin() + end);
    row.values.resize(row.columns.size());
    row.kept = keep(row.columns.size());
  }
  pair_rows_.resize(problem.pairs());
  for (Index i = 0; i < problem.pairs(); ++i) {
    Row& row = pair_rows_[i];
    Index p = problem.rows.row_pointers[problem.layout.s(i)];
    Index q = problem.rows.row_pointers[problem.layout.t(i)];
    const Index p_end = problem.rows.row_pointers[problem.layout.s(i) + 1];
    const Index q_end = problem.rows.row_pointers[problem.layout.t(i) + 1];
    while (p < p_end || q < q_end) {
      const Index s_column = p < p_end ? problem.rows.column_indices[p] : variables_;
      const Index t_column = q < q_end ? problem.rows.column_indices[q] : variables_;
      row.columns.push_back(std::min(s_column, t_column));
      if (s_column <= t_column) ++p;
      if (t_column <= s_column) ++q;
    }
    row.values.resize(row.columns.size());
    row.second_values.resize(row.columns.size());
    row.kept = keep(row.columns.size());
  }
}

bool SparseKkt::build_pattern(const ScaledProblem& problem) {
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

  PatternBuilder builder(size_);
  Checkpoint checkpoint(interrupt());
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
      for (std::size_t a = 0; a < length && !checkpoint.reached(static_cast<std::int64_t>(a)); ++a) {
        for (std::size_t b = 0; b <= a; ++b) visit(row.columns[a], row.columns[b], row.slots);
      }
    }
  };
  const auto visit_rows = [&](auto&& visit) {
    std::size_t number = 0;
    for (Row& row : inequality_rows_) visit_row(row, first_kept[number++], visit);
    for (Row& row : pair_rows_) visit_row(row, first_kept[number++], visit);
  };

  for (Index i = 0; i < size_; ++i) builder.add(i, i);
  visit_constants([&](Index a, Index b) { builder.add(a, b); });
  visit_rows([&](Index a, Index b, std::vector<Index>&) { builder.add(a, b); });
  builder.compress(checkpoint);
  if (checkpoint.reached(0) || !ldl_.analyse(builder.pattern, interrupt())) return false;
  const auto slot = [&](Index a, Index b) { return ldl_.places()[builder.slot(a, b)]; };

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
  ldl_.forget_places();
  flops_ = estimated_flops();
  return !checkpoint.reached(0);
}

// Counts the factorization and the assembly of the matrix.
double SparseKkt::estimated_flops() const {
  double flops = static_cast<double>(ldl_.matrix().rows.size()) + ldl_.flops();
  for (const auto* group : {&inequality_rows_, &pair_rows_}) {
    for (const Row& row : *group) {
      const auto length = static_cast<double>(row.columns.size());
      flops += row.kept ? 2.0 * length : length * (length + 1.0);
    }
  }
  return flops;
}

void SparseKkt::load(const ScaledProblem& problem) {
  std::fill(constant_.begin(), constant_.end(), 0.0);
  auto slot = constant_slots_.begin();
  for (const auto* values : {&problem.Q.values, &problem.A.values}) {
    for (const double value : *values) constant_[*slot++] += value;
  }
  for (Index i = 0; i < problem.inequalities(); ++i) {
    const auto begin = problem.rows.values.begin() + problem.rows.row_pointers[i];
    std::copy_n(begin, problem.rows.row_size(i), inequality_rows_[i].values.begin());
  }
  const auto spread = [&matrix = problem.rows](Index i, const Row& row, std::vector<double>& values) {
    Index k = matrix.row_pointers[i];
    for (std::size_t at = 0; at < values.size(); ++at) {
      const bool here = k < matrix.row_pointers[i + 1] && matrix.column_indices[k] == row.columns[at];
      values[at] = here ? matrix.values[k++] : 0.0;
    }
  };
  for (Index i = 0; i < problem.pairs(); ++i) {
    spread(problem.layout.s(i), pair_rows_[i], pair_rows_[i].values);
    spread(problem.layout.t(i), pair_rows_[i], pair_rows_[i].second_values);
  }
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
    const double weight = weights.rows.all[static_cast<Index>(i)];
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
    const double cosine = weights.cosine[index];
    const double sine = weights.sine[index];
    const double weight_s = weights.rows.s()[index];
    const double weight_t = weights.rows.t()[index];
    if (!row.kept) {
      add_condensed(row, weight_s * cosine * cosine + weight_t * sine * sine,
                    (weight_s - weight_t) * cosine * sine,
                    weight_s * sine * sine + weight_t * cosine * cosine);
      continue;
    }
    for (std::size_t k = 0; k < row.slots.size(); ++k) {
      values_[row.slots[k]] = cosine * row.values[k] + sine * row.second_values[k];
      values_[row.second_slots[k]] = sine * row.values[k] - cosine * row.second_values[k];
    }
    values_[row.diagonal] = minus_inverse(weight_s);
    values_[row.second_diagonal] = minus_inverse(weight_t);
  }
}

Index SparseKkt::kept_negative_weights(const RowWeights& weights) const {
  const auto negative = [](double weight) { return weight <= -tuning::roundoff ? 1 : 0; };
  Index count = 0;
  for (std::size_t i = 0; i < pair_rows_.size(); ++i) {
    if (!pair_rows_[i].kept) continue;
    const auto pair = static_cast<Index>(i);
    count += negative(weights.rows.s()[pair]) + negative(weights.rows.t()[pair]);
  }
  return count;
}

bool SparseKkt::factorize(const RowWeights& weights) {
  assemble(weights);
  if (!ldl_.factorize(values_, interrupt())) return false;
  // Haynsworth: a kept row with k > 0 requires a negative pivot, one with k < 0 a positive pivot.
  return ldl_.positive_pivots() == variables_ + kept_negative_weights(weights);
}

// Skips the part of the forward substitution that is 0, which is most of it.
bool SparseKkt::solve_sparse(std::span<const Index> indices, std::span<const double> values, VectorRef x) {
  const std::vector<Index>& position = ldl_.position();
  solution_.setZero();
  Index first = size_;
  for (std::size_t k = 0; k < indices.size(); ++k) {
    const Index at = position[indices[k]];
    solution_[at] = values[k];
    first = std::min(first, at);
  }
  if (!ldl_.solve(solution_.data(), first, interrupt())) return false;
  for (Index i = 0; i < variables_; ++i) x[i] = solution_[position[i]];
  return true;
}

bool SparseKkt::refine() {
  const Pattern& matrix = ldl_.matrix();
  residual_ = right_side_;
  for (Index column = 0; column < size_; ++column) {
    double sum = 0.0;
    for (Index k = matrix.pointers[column]; k < matrix.pointers[column + 1]; ++k) {
      const Index row = matrix.rows[k];
      sum += values_[k] * solution_[row];
      if (row != column) residual_[row] -= values_[k] * solution_[column];
    }
    residual_[column] -= sum;
  }
  if (!ldl_.solve(residual_.data(), 0, interrupt())) return false;
  solution_ += residual_;
  return true;
}

template <class T>
bool SparseKkt::solve_lanes(T* x, T* y, T* work) {
  const std::vector<Index>& position = ldl_.position();
  for (Index i = variables_ + equalities_; i < size_; ++i) work[position[i]] = T{};
  for (Index i = 0; i < variables_; ++i) work[position[i]] = x[i];
  for (Index i = 0; i < equalities_; ++i) work[position[variables_ + i]] = y[i];
  if (!ldl_.solve(work, 0, interrupt())) return false;
  for (Index i = 0; i < variables_; ++i) x[i] = work[position[i]];
  for (Index i = 0; i < equalities_; ++i) y[i] = work[position[variables_ + i]];
  return true;
}

bool SparseKkt::solve_many(double* x, double* y, int count) {
  if (count == 1) return solve_lanes(x, y, solution_.data());
  if (many_.size() < static_cast<Eigen::Index>(size_) * count)
    many_.resize(static_cast<Eigen::Index>(size_) * count);
  const auto solve = [&]<int N>(std::integral_constant<int, N>) {
    return solve_lanes(reinterpret_cast<Lanes<N>*>(x), reinterpret_cast<Lanes<N>*>(y),
                       reinterpret_cast<Lanes<N>*>(many_.data()));
  };
  switch (count) {
    case 2:
      return solve(std::integral_constant<int, 2>());
    case 4:
      return solve(std::integral_constant<int, 4>());
    default:
      return solve(std::integral_constant<int, 8>());
  }
}

bool SparseKkt::solve(VectorRef x, VectorRef y) {
  const std::vector<Index>& position = ldl_.position();
  right_side_.setZero();
  for (Index i = 0; i < variables_; ++i) right_side_[position[i]] = x[i];
  for (Index i = 0; i < equalities_; ++i) right_side_[position[variables_ + i]] = y[i];
  solution_ = right_side_;
  if (!ldl_.solve(solution_.data(), 0, interrupt()) || !refine()) return false;
  for (Index i = 0; i < variables_; ++i) x[i] = solution_[position[i]];
  for (Index i = 0; i < equalities_; ++i) y[i] = solution_[position[variables_ + i]];
  return true;
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
  const auto pattern_entries = static_cast<double>(ldl_.matrix().rows.size());
  return ldl_.bytes() + pattern_entries * 2.0 * sizeof(double) + slots * sizeof(Index) +
         row_entries * (2.0 * sizeof(double) + sizeof(Index)) +
         static_cast<double>(inequality_rows_.size() + pair_rows_.size()) * sizeof(Row) +
         size_ * ((3.0 + 8.0) * sizeof(double) + 2.0 * sizeof(Index));
}

}  // namespace marble
