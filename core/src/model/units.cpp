#include "model/units.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Returns log₂ of each number's size to half a unit, which is all that units need. NaN for a zero, and for
// the rounding error of a sum of numbers as large as the largest.
template <class Values>
std::vector<double> log_sizes(const Values& values) {
  double largest = 0.0;
  for (const double value : values) largest = std::max(largest, std::abs(value));
  std::vector<double> logs;
  logs.reserve(static_cast<std::size_t>(values.size()));
  for (const double value : values) {
    const bool counts = std::abs(value) > tuning::roundoff * largest;
    logs.push_back(counts ? std::ilogb(value) + 0.5 : kNone);
  }
  return logs;
}

// Computes the optimal value of an unknown that appears once in each term: minus the mean of the remainders.
struct Means {
  explicit Means(Eigen::Index size) : sum(Vector::Zero(size)), weight(Vector::Zero(size)) {}
  void add(Eigen::Index i, double rest, double factor = 1.0) {
    sum[i] -= factor * rest;
    weight[i] += factor * factor;
  }
  [[nodiscard]] Vector values() const { return sum.cwiseQuotient(weight.cwiseMax(1.0)); }
  Vector sum, weight;
};

// Minimizes the sum over rows, columns and the cost in turn, as logarithms.
class Fit {
 public:
  explicit Fit(const ScaledProblem& p)
      : p_(p),
        logs_{log_sizes(p.Q.values), log_sizes(p.A.values), log_sizes(p.rows.values),
              log_sizes(p.g),        log_sizes(p.b),        log_sizes(p.offset)},
        row_(Vector::Zero(p.A.rows + p.rows.rows)),
        column_(Vector::Zero(p.variables())) {}

  /// Leaves out the constants that may be rounding errors of their row's sum, if its variables are of size
  /// 2^columns. Returns whether there are any.
  bool leave_out_noise(const Vector& columns) {
    const bool of_A = leave_out_noise(p_.A, logs_.A, columns, logs_.b);
    return leave_out_noise(p_.rows, logs_.rows, columns, logs_.offset) || of_A;
  }
  /// True if all numbers are within the range in which units stay 1.
  [[nodiscard]] bool near_one() const {
    const auto near = [](const std::vector<double>& logs) {
      return std::ranges::all_of(logs, [](double log) { return !(std::abs(log) > tuning::units_bits); });
    };
    return near(logs_.Q) && near(logs_.A) && near(logs_.rows) && near(logs_.g) && near(logs_.b) &&
           near(logs_.offset);
  }
  void improve(const Interrupt& interrupt) {
    if (near_one()) return;
    for (int pass = 0; pass < tuning::units_passes && !interrupt.requested(); ++pass) {
      improve_rows();
      improve_columns();
      improve_size_and_cost();
    }
  }
  [[nodiscard]] const Vector& columns() const { return column_; }
  [[nodiscard]] ScaleFactors units() const {
    const double most = std::floor(std::log2(tuning::scale_range));
    const auto rounded = [most](double log) {
      return std::abs(log) < tuning::units_bits ? 1.0 : std::exp2(std::clamp(std::round(log), -most, most));
    };
    return {column_.unaryExpr(rounded), row_.head(p_.A.rows).unaryExpr(rounded),
            row_.tail(p_.rows.rows).unaryExpr(rounded), rounded(cost_)};
  }

 private:
  static bool leave_out_noise(const RowMatrix& matrix, const std::vector<double>& logs, const Vector& columns,
                              std::vector<double>& constants) {
    Vector largest = Vector::Constant(matrix.rows, -std::numeric_limits<double>::infinity());
    visit_rows(matrix, logs, 0, [&](Index row, Index column, double log) {
      largest[row] = std::max(largest[row], log + columns[column]);
    });
    const double least = std::log2(tuning::constant_noise);
    bool any = false;
    for (Index row = 0; row < matrix.rows; ++row) {
      if (!(constants[static_cast<std::size_t>(row)] <= least + largest[row])) continue;
      constants[static_cast<std::size_t>(row)] = kNone;
      any = true;
    }
    return any;
  }
  template <class Visit>
  void visit_entries(Visit&& visit) const {
    visit_rows(p_.A, logs_.A, 0, visit);
    visit_rows(p_.rows, logs_.rows, p_.A.rows, visit);
  }
  template <class Visit>
  static void visit_rows(const RowMatrix& matrix, const std::vector<double>& logs, Index first,
                         Visit&& visit) {
    for (Index row = 0; row < matrix.rows; ++row) {
      for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
        const double log = logs[static_cast<std::size_t>(k)];
        if (!std::isnan(log)) visit(first + row, matrix.column_indices[k], log);
      }
    }
  }
  template <class Visit>
  void visit_hessian(Visit&& visit) const {
    for (Index j = 0; j < p_.Q.size; ++j) {
      for (Index k = p_.Q.column_pointers[j]; k < p_.Q.column_pointers[j + 1]; ++k) {
        const double log = logs_.Q[static_cast<std::size_t>(k)];
        if (!std::isnan(log)) visit(p_.Q.row_indices[k], j, log);
      }
    }
  }
  template <class Visit>
  static void visit_vector(const std::vector<double>& logs, Index first, Visit&& visit) {
    for (std::size_t i = 0; i < logs.size(); ++i) {
      if (!std::isnan(logs[i])) visit(first + static_cast<Index>(i), logs[i]);
    }
  }
  template <class Visit>
  void visit_constants(Visit&& visit) const {
    visit_vector(logs_.b, 0, visit);
    visit_vector(logs_.offset, p_.A.rows, visit);
  }

  void improve_rows() {
    Means means(row_.size());
    visit_entries([&](Index i, Index j, double log) { means.add(i, log + column_[j]); });
    visit_constants([&](Index i, double log) { means.add(i, log); });
    row_ = means.values();
  }

  void improve_columns() {
    Means means(column_.size());
    visit_entries([&](Index i, Index j, double log) { means.add(j, log + row_[i]); });
    visit_vector(logs_.g, 0, [&](Index j, double log) { means.add(j, log + cost_); });
    visit_hessian([&](Index i, Index j, double log) {
      if (i == j) {
        means.add(j, log + cost_, 2.0);
      } else {
        means.add(j, log + cost_ + column_[i]);
        means.add(i, log + cost_ + column_[j]);
      }
    });
    column_ = means.values();
  }

  // Changes all variables by α, all rows by −α, and the cost by γ. With many rows, updates in turn alone
  // converge slowly in this direction.
  void improve_size_and_cost() {
    double aa = 0.0, ag = 0.0, gg = 0.0, a = 0.0, g = 0.0;
    const auto add = [&](double rest, double alpha, double gamma) {
      aa += alpha * alpha;
      ag += alpha * gamma;
      gg += gamma * gamma;
      a -= alpha * rest;
      g -= gamma * rest;
    };
    visit_hessian(
        [&](Index i, Index j, double log) { add(log + cost_ + column_[i] + column_[j], 2.0, 1.0); });
    visit_vector(logs_.g, 0, [&](Index j, double log) { add(log + cost_ + column_[j], 1.0, 1.0); });
    visit_constants([&](Index i, double log) { add(log + row_[i], -1.0, 0.0); });
    const double determinant = aa * gg - ag * ag;
    // One of them is undetermined if there are no constants and not both Q and g.
    const bool both = determinant > 0.5;
    const double alpha = both ? (gg * a - ag * g) / determinant : gg > 0.0 || aa == 0.0 ? 0.0 : a / aa;
    const double gamma = both ? (aa * g - ag * a) / determinant : gg > 0.0 ? g / gg : 0.0;
    column_.array() += alpha;
    row_.array() -= alpha;
    cost_ += gamma;
  }

  const ScaledProblem& p_;
  struct {
    std::vector<double> Q, A, rows, g, b, offset;
  } logs_;
  Vector row_, column_;
  double cost_ = 0.0;
};

}  // namespace

ScaleFactors choose_units(const ScaledProblem& p, const Interrupt& interrupt) {
  Fit fit(p);
  const bool noise = fit.leave_out_noise(Vector::Zero(p.variables()));
  fit.improve(interrupt);
  if (!noise) return fit.units();
  Fit again(p);  // what looked like noise in the user's units may be data in these
  again.leave_out_noise(fit.columns());
  again.improve(interrupt);
  return again.units();
}

}  // namespace marble
