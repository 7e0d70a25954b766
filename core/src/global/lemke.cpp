#include "global/lemke.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "model/linear_algebra.h"
#include "model/tuning.h"
#include "path/noise.h"

namespace marble {
namespace {

// What a row or column of the tableau stands for: a row of [C; L; R], by its number, or one of these: an
// equality's value, a variable, or θ.
enum : Index { kTheta = -3, kVariable, kEquality };

using std::abs;

// Squared for twice as many digits.
template <class Scalar>
constexpr double tolerance(double of_doubles) {
  return std::is_same_v<Scalar, double> ? of_doubles : of_doubles * of_doubles;
}

}  // namespace

template <class Scalar>
bool Lemke<Scalar>::applies() const {
  const double rows = problem_.equalities() + 2.0 * problem_.pairs();
  const double most = std::is_same_v<Scalar, double> ? tuning::lemke_entries : tuning::lemke_careful_entries;
  return problem_.pairs() > 0 && problem_.inequalities() == 0 &&
         problem_.variables() >= problem_.equalities() + problem_.pairs() &&
         rows * problem_.variables() <= most;
}

// All rows as functions of z: equalities, then sides.
template <class Scalar>
void Lemke<Scalar>::fill() {
  const Index n = problem_.variables();
  const Index n_e = problem_.equalities();
  const Index n_s = 2 * problem_.pairs();
  tableau_.setZero(n_e + n_s, n + 1);
  basic_.clear();
  nonbasic_.assign(static_cast<std::size_t>(n), kVariable);
  const auto copy = [&](const RowMatrix& from, const Vector& offset, Index first) {
    for (Index row = 0; row < from.rows; ++row) {
      for (Index k = from.row_pointers[row]; k < from.row_pointers[row + 1]; ++k)
        tableau_(first + row, from.column_indices[k]) += from.values[k];
      tableau_(first + row, n) = offset[row];
    }
  };
  copy(problem_.A, problem_.b, 0);
  copy(problem_.rows, problem_.offset, n_e);
  for (Index row = 0; row < n_e; ++row) basic_.push_back(kEquality);
  for (Index row = 0; row < n_s; ++row) basic_.push_back(row);
}

// Exchanges a basic variable and a nonbasic one (pivot).
template <class Scalar>
void Lemke<Scalar>::exchange(Index row, Index column) {
  const Scalar pivot = tableau_(row, column);
  tableau_.row(row) /= -pivot;
  tableau_(row, column) = Scalar(1.0) / pivot;
  for (Index i = 0; i < tableau_.rows(); ++i) {
    const Scalar factor = tableau_(i, column);
    if (i == row || factor == Scalar(0.0)) continue;
    tableau_(i, column) = Scalar(0.0);
    tableau_.row(i) += factor * tableau_.row(row);
  }
  std::swap(basic_[static_cast<std::size_t>(row)], nonbasic_[static_cast<std::size_t>(column)]);
}

// Returns the variable on which a row depends most; −1 if on none.
template <class Scalar>
Index Lemke<Scalar>::best_column(Index row) const {
  Index best = -1;
  Scalar most = tolerance<Scalar>(tuning::rounding);
  for (std::size_t column = 0; column < nonbasic_.size(); ++column) {
    const Scalar size = abs(tableau_(row, static_cast<Index>(column)));
    if (nonbasic_[column] != kVariable || !(size > most)) continue;
    best = static_cast<Index>(column);
    most = size;
  }
  return best;
}

// Makes each equality and one side of each pair nonbasic: in even-numbered attempts the side that looks like
// a bound, in odd ones a random side.
template <class Scalar>
bool Lemke<Scalar>::choose_unknowns(const Run& run, int way) {
  fill();
  const Index n_e = problem_.equalities();
  for (Index row = 0; row < n_e; ++row) {
    if (run.interrupted()) return false;
    const Index column = best_column(row);
    if (column >= 0) {
      exchange(row, column);
    } else if (abs(tableau_(row, tableau_.cols() - 1)) > tolerance<Scalar>(tuning::exactness)) {
      return false;
    }
  }
  const Index pairs = problem_.pairs();
  const auto& begin = problem_.rows.row_pointers;
  std::vector<Index> late;
  for (Index pair = 0; pair < pairs; ++pair) {
    if (run.interrupted()) return false;
    const auto looks = [&](Index row) {
      return std::abs(problem_.offset[row]) * (problem_.variables() + 1.0) + (begin[row + 1] - begin[row]);
    };
    const bool s_first = way % 2 == 0 ? looks(pair) <= looks(pairs + pair) : noise(way, pair) < 0.5;
    const Index first = n_e + (s_first ? pair : pairs + pair);
    const Index second = n_e + (s_first ? pairs + pair : pair);
    Index column = best_column(first);
    const Index row = column >= 0 ? first : second;
    if (column < 0) column = best_column(second);
    if (column >= 0) {
      exchange(row, column);
    } else {
      late.push_back(pair);
    }
  }
  return std::ranges::all_of(late, [this](Index pair) { return make_room(pair); });
}

// Handles a pair whose two sides depend only on other unknowns: one of them takes the place of a side of
// another pair, whose other side can become an unknown.
template <class Scalar>
bool Lemke<Scalar>::make_room(Index pair) {
  const Index n_e = problem_.equalities();
  const Index pairs = problem_.pairs();
  for (const Index side : {n_e + pair, n_e + pairs + pair}) {
    for (std::size_t column = 0; column < nonbasic_.size(); ++column) {
      const Index unknown = nonbasic_[column];
      if (unknown < 0 || abs(tableau_(side, static_cast<Index>(column))) < tolerance<Scalar>(tuning::near))
        continue;
      const Index other = n_e + (unknown < pairs ? unknown + pairs : unknown - pairs);
      if (basic_[static_cast<std::size_t>(other)] < 0) continue;
      const Index free = best_column(other);
      if (free < 0) continue;
      exchange(side, static_cast<Index>(column));
      const Index place = best_column(other);
      if (place >= 0) {
        exchange(other, place);
        return true;
      }
      exchange(side, static_cast<Index>(column));
    }
  }
  return false;
}

// Reduces the tableau to w = M x + q + d θ, perturbed so that no two rows block at once.
template <class Scalar>
void Lemke<Scalar>::reduce(int way, ConstVectorRef z) {
  std::vector<Index> rows, columns;
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1> constant = tableau_.col(tableau_.cols() - 1);
  for (std::size_t k = 0; k < basic_.size(); ++k) {
    if (basic_[k] >= 0) rows.push_back(static_cast<Index>(k));
  }
  for (std::size_t k = 0; k < nonbasic_.size(); ++k) {
    if (nonbasic_[k] >= 0) columns.push_back(static_cast<Index>(k));
    // Its column is still its own: only variables that were exchanged have moved.
    if (nonbasic_[k] == kVariable)
      constant += Scalar(z[static_cast<Index>(k)]) * tableau_.col(static_cast<Index>(k));
  }
  const auto size = static_cast<Index>(columns.size());
  Tableau reduced(static_cast<Index>(rows.size()), size + 2);
  std::vector<Index> basic, nonbasic;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto row = static_cast<Index>(i);
    for (Index j = 0; j < size; ++j)
      reduced(row, j) = tableau_(rows[i], columns[static_cast<std::size_t>(j)]);
    const Scalar q = constant[rows[i]];
    const double shift = noise(0, static_cast<std::uint64_t>(row));
    const bool bound = q > Scalar(0.0) &&
                       reduced.row(row).head(size).maxCoeff() <= Scalar(tolerance<Scalar>(tuning::exactness));
    reduced(row, size) = Scalar(bound ? 0.0 : way == 0 ? 1.0 : 0.5 + noise(way, row));
    reduced(row, size + 1) = q + Scalar(tolerance<Scalar>(tuning::near * tuning::alike) * (1.0 + shift));
    basic.push_back(basic_[static_cast<std::size_t>(rows[i])]);
  }
  for (const Index column : columns) nonbasic.push_back(nonbasic_[static_cast<std::size_t>(column)]);
  nonbasic.push_back(kTheta);
  tableau_.swap(reduced);
  basic_.swap(basic);
  nonbasic_.swap(nonbasic);
}

// Returns the first row that reaches zero as a nonbasic variable grows; θ comes before others. −1 if there is
// none.
template <class Scalar>
Index Lemke<Scalar>::blocking_row(Index column) const {
  Index first = -1;
  Scalar shortest = std::numeric_limits<double>::infinity();
  const auto last = static_cast<Index>(tableau_.cols() - 1);
  const Scalar tie = Scalar(1.0) + Scalar(tolerance<Scalar>(tuning::exactness));
  for (Index row = 0; row < tableau_.rows(); ++row) {
    const Scalar rate = tableau_(row, column);
    if (rate > Scalar(-tolerance<Scalar>(tuning::exactness))) continue;
    const Scalar length = std::max(tableau_(row, last), Scalar(0.0)) / -rate;
    const bool theta = basic_[static_cast<std::size_t>(row)] == kTheta;
    if (theta ? length <= shortest * tie : length < shortest) {
      first = row;
      shortest = length;
    }
  }
  return first;
}

template <class Scalar>
bool Lemke<Scalar>::follow(Run& run) {
  const auto theta = static_cast<Index>(tableau_.cols() - 2);
  Index row = -1;
  Scalar most = 0.0;
  for (Index i = 0; i < tableau_.rows(); ++i) {
    const Scalar needed = -tableau_(i, theta + 1) / tableau_(i, theta);
    if (tableau_(i, theta + 1) >= Scalar(0.0) || !(needed > most)) continue;
    row = i;
    most = needed;
  }
  if (row < 0) return true;
  Index column = theta;
  const Index pairs = problem_.pairs();
  const Index pivots = tuning::lemke_pivots * pairs;
  for (Index pivot = 0; pivot < pivots && !run.interrupted(); ++pivot) {
    if (pivot % pairs == 0) ++run.factorizations;  // n pivots of one row each
    const Index leaving = basic_[static_cast<std::size_t>(row)];
    exchange(row, column);
    if (leaving == kTheta) return true;
    const Index entering = leaving < pairs ? leaving + pairs : leaving - pairs;
    column = static_cast<Index>(std::ranges::find(nonbasic_, entering) - nonbasic_.begin());
    if (column >= theta + 1) return false;
    row = blocking_row(column);
    if (row < 0) return false;
  }
  return false;
}

template <class Scalar>
bool Lemke<Scalar>::run(Run& run, int way, ConstVectorRef z, WorkingSet& set) {
  ++run.factorizations;
  if (!choose_unknowns(run, way)) return false;
  reduce(way, z);
  if (tableau_.rows() != problem_.pairs() || tableau_.cols() != problem_.pairs() + 2) return false;
  if (!follow(run)) return false;
  for (const Index side : nonbasic_) {
    if (side < 0) continue;
    const Index pair = side % problem_.pairs();
    set.fix(pair, side < problem_.pairs(), false);
  }
  return true;
}

template <class Scalar>
bool Lemke<Scalar>::solve_branch(const WorkingSet& set, ConstVectorRef z, Iterate& x) {
  fill();
  const Index n_e = problem_.equalities();
  const Index variables = problem_.variables();
  const Index constant = variables;
  std::vector<Index> row_of(static_cast<std::size_t>(variables), -1);  // of a basic variable
  for (Index i = 0; i < n_e + problem_.pairs(); ++i) {
    const Index row = i < n_e ? i : n_e + set.fixed_row(i - n_e);
    const Index column = best_column(row);
    if (column >= 0) {
      exchange(row, column);
      row_of[static_cast<std::size_t>(column)] = row;
    } else if (abs(tableau_(row, constant)) > tolerance<Scalar>(tuning::exactness)) {
      return false;
    }
  }
  x.all.setZero();
  for (Index j = 0; j < variables; ++j) {
    const Index row = row_of[static_cast<std::size_t>(j)];
    if (row < 0) {
      x.z()[j] = z[j];
      continue;
    }
    Scalar value = tableau_(row, constant);
    for (Index k = 0; k < variables; ++k) {
      if (row_of[static_cast<std::size_t>(k)] < 0) value += tableau_(row, k) * Scalar(z[k]);
    }
    x.z()[j] = static_cast<double>(value);
  }
  // The objective's gain when a row is released: its column contains the rates of all basic variables.
  Vector gradient(variables);
  multiply(problem_.Q, x.z(), gradient);
  gradient += problem_.g;
  for (Index j = 0; j < variables; ++j) {
    const Index row = row_of[static_cast<std::size_t>(j)];
    if (row < 0) continue;
    Scalar gain = 0.0;
    for (Index k = 0; k < variables; ++k) {
      const Index basic = row_of[static_cast<std::size_t>(k)];
      if (basic >= 0) gain += Scalar(gradient[k]) * tableau_(basic, j);
    }
    (row < n_e ? x.y()[row] : x.lambda()[row - n_e]) = -static_cast<double>(gain);
  }
  return x.all.allFinite();
}

template class Lemke<double>;
template class Lemke<DoubleDouble>;

}  // namespace marble
