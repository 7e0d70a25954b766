#include "nl/nl_nonlinear.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "nl/asl_functions.h"
#include "nl/expression_file.h"

namespace marble::formats {
namespace {

std::size_t at(Index index) { return static_cast<std::size_t>(index); }

// A block of functions: M w + offset, where w has the variables, the file's rows, and the variables that
// mixed complementarity adds.
class BlockOfRows {
 public:
  BlockOfRows(SparseMatrix M, std::vector<double> offset, std::size_t n, const SparseMatrix& jacobian)
      : M_(std::move(M)), offset_(std::move(offset)), values_(offset_.size()) {
    derive(n, jacobian);
  }

  std::span<const double> values(std::span<const double> w) {
    values_ = offset_;
    for (std::size_t j = 0; j < w.size(); ++j) {
      for (Index k = M_.column_pointers[j]; k < M_.column_pointers[j + 1]; ++k)
        values_[at(M_.row_indices[at(k)])] += M_.values[at(k)] * w[j];
    }
    return values_;
  }
  SparseMatrixView derivatives(const SparseMatrix& jacobian) {
    std::ranges::fill(derivative_.values, 0.0);
    for (const Share& share : shares_) {
      const double factor = share.of < 0 ? 1.0 : jacobian.values[at(share.of)];
      derivative_.values[at(share.entry)] += share.coefficient * factor;
    }
    return derivative_.view();
  }
  /// result += factor · Mᵀ multipliers.
  void add_transposed(std::span<const double> multipliers, double factor, std::vector<double>& result) const {
    for (std::size_t j = 0; j < result.size(); ++j) {
      for (Index k = M_.column_pointers[j]; k < M_.column_pointers[j + 1]; ++k)
        result[j] += factor * M_.values[at(k)] * multipliers[at(M_.row_indices[at(k)])];
    }
  }

 private:
  // A term of a derivative's entry: a coefficient times an entry of the rows' Jacobian.
  struct Share {
    Index entry, of;  // of: −1 if there is none
    double coefficient;
  };
  struct Draft {
    Index column, row, of;
    double coefficient;
  };

  void derive(std::size_t n, const SparseMatrix& jacobian) {
    const std::size_t m = at(jacobian.rows);
    std::vector<std::vector<std::pair<Index, double>>> of_row(m);  // rows of the block with a row of the file
    std::vector<Draft> drafts;
    for (std::size_t j = 0; j < at(M_.columns); ++j) {
      for (Index k = M_.column_pointers[j]; k < M_.column_pointers[j + 1]; ++k) {
        const Index row = M_.row_indices[at(k)];
        const double coefficient = M_.values[at(k)];
        if (j >= n && j < n + m) {
          of_row[j - n].emplace_back(row, coefficient);
        } else {
          drafts.push_back({static_cast<Index>(j < n ? j : j - m), row, -1, coefficient});
        }
      }
    }
    for (std::size_t j = 0; j < n; ++j) {
      for (Index k = jacobian.column_pointers[j]; k < jacobian.column_pointers[j + 1]; ++k) {
        for (const auto& [row, coefficient] : of_row[at(jacobian.row_indices[at(k)])])
          drafts.push_back({static_cast<Index>(j), row, k, coefficient});
      }
    }
    std::ranges::stable_sort(drafts, [](const Draft& a, const Draft& b) {
      return std::pair(a.column, a.row) < std::pair(b.column, b.row);
    });
    derivative_.rows = static_cast<Index>(offset_.size()), derivative_.columns = M_.columns - jacobian.rows;
    derivative_.column_pointers.assign(at(derivative_.columns) + 1, 0);
    for (std::size_t k = 0; k < drafts.size(); ++k) {
      const Draft& draft = drafts[k];
      if (k == 0 || draft.column != drafts[k - 1].column || draft.row != drafts[k - 1].row) {
        derivative_.row_indices.push_back(draft.row);
        ++derivative_.column_pointers[at(draft.column) + 1];
      }
      shares_.push_back(
          {static_cast<Index>(derivative_.row_indices.size()) - 1, draft.of, draft.coefficient});
    }
    for (std::size_t j = 0; j + 1 < derivative_.column_pointers.size(); ++j)
      derivative_.column_pointers[j + 1] += derivative_.column_pointers[j];
    derivative_.values.assign(derivative_.row_indices.size(), 0.0);
  }

  SparseMatrix M_;
  std::vector<double> offset_, values_;
  SparseMatrix derivative_;
  std::vector<Share> shares_;
};

// All functions of one file, as the loop calls them.
class FileFunctions {
 public:
  FileFunctions(AslFunctions functions, OwnedProblem linear, std::size_t n, std::size_t m, double sign,
                std::span<const double> start)
      : functions_(std::move(functions)),
        n_(n),
        m_(m),
        sign_(sign),
        w_(linear.g.size()),
        weights_(w_.size()),
        gradient_(w_.size() - m) {
    const SparseMatrix& jacobian = functions_.jacobian(start.first(n));
    E_.emplace(std::move(linear.A), std::move(linear.b), n, jacobian);
    I_.emplace(std::move(linear.C), std::move(linear.d), n, jacobian);
    G_.emplace(std::move(linear.L), std::move(linear.l), n, jacobian);
    H_.emplace(std::move(linear.R), std::move(linear.r), n, jacobian);
  }

  nonlinear::Values values(std::span<const double> x) {
    take(x);
    return {.objective = sign_ * functions_.objective(x.first(n_)),
            .equalities = E_->values(w_),
            .inequalities = I_->values(w_),
            .G = G_->values(w_),
            .H = H_->values(w_)};
  }

  nonlinear::Derivatives derivatives(std::span<const double> x) {
    functions_.gradient(x.first(n_), std::span(gradient_).first(n_));
    for (std::size_t j = 0; j < n_; ++j) gradient_[j] *= sign_;
    const SparseMatrix& jacobian = functions_.jacobian(x.first(n_));
    return {.gradient = gradient_,
            .equalities = E_->derivatives(jacobian),
            .inequalities = I_->derivatives(jacobian),
            .G = G_->derivatives(jacobian),
            .H = H_->derivatives(jacobian)};
  }

  SparseMatrixView hessian(std::span<const double> x, const nonlinear::Multipliers& multipliers) {
    std::ranges::fill(weights_, 0.0);
    E_->add_transposed(multipliers.equalities, 1.0, weights_);
    I_->add_transposed(multipliers.inequalities, -1.0, weights_);
    G_->add_transposed(multipliers.G, -1.0, weights_);
    H_->add_transposed(multipliers.H, -1.0, weights_);
    const SparseMatrix& upper = functions_.hessian(x.first(n_), sign_, std::span(weights_).subspan(n_, m_));
    if (gradient_.size() == n_) return upper.view();
    hessian_ = upper;  // with empty columns for variables that mixed complementarity adds
    hessian_.rows = hessian_.columns = static_cast<Index>(gradient_.size());
    hessian_.column_pointers.resize(gradient_.size() + 1, hessian_.column_pointers.back());
    return hessian_.view();
  }

 private:
  void take(std::span<const double> x) {
    std::copy_n(x.begin(), n_, w_.begin());
    functions_.rows(x.first(n_), std::span(w_).subspan(n_, m_));
    std::copy(x.begin() + static_cast<std::ptrdiff_t>(n_), x.end(),
              w_.begin() + static_cast<std::ptrdiff_t>(n_ + m_));
  }

  AslFunctions functions_;
  std::size_t n_, m_;
  double sign_;
  std::vector<double> w_, weights_, gradient_;
  std::optional<BlockOfRows> E_, I_, G_, H_;
  SparseMatrix hessian_;
};

// The weighted sum of the derivatives of all functions.
class SumOfAll {
 public:
  SumOfAll(AslFunctions& functions, std::size_t n, std::size_t m)
      : functions_(functions), n_(n), weights_(m) {
    for (std::size_t i = 0; i < m; ++i) weights_[i] = 1.0 / (1.0 + static_cast<double>(i % 5));
  }

  [[nodiscard]] std::vector<double> slope(const std::vector<double>& x) {
    std::vector<double> sum(n_);
    functions_.gradient(x, sum);
    const SparseMatrix& J = functions_.jacobian(x);
    for (std::size_t j = 0; j < n_ && !weights_.empty(); ++j) {
      for (Index k = J.column_pointers[j]; k < J.column_pointers[j + 1]; ++k)
        sum[j] += J.values[at(k)] * weights_[at(J.row_indices[at(k)])];
    }
    return sum;
  }

  /// Returns the second derivatives times a direction.
  [[nodiscard]] std::vector<double> product(const std::vector<double>& x,
                                            const std::vector<double>& direction) {
    std::vector<double> product(n_, 0.0);
    const SparseMatrix& H = functions_.hessian(x, 1.0, weights_);
    for (std::size_t j = 0; j < n_; ++j) {
      for (Index k = H.column_pointers[j]; k < H.column_pointers[j + 1]; ++k) {
        const std::size_t i = at(H.row_indices[at(k)]);
        product[i] += H.values[at(k)] * direction[j];
        if (i != j) product[j] += H.values[at(k)] * direction[i];
      }
    }
    return product;
  }

 private:
  AslFunctions& functions_;
  std::size_t n_;
  std::vector<double> weights_;
};

// Checks the library's second derivatives against its first ones at x in one direction: it errs if linear
// terms within a function cancel. Long differences are wrong near a pole, short ones have few digits:
// agreement with one is enough. True if this cannot be decided.
bool second_derivatives_agree(AslFunctions& functions, const std::vector<double>& x, std::size_t m) {
  constexpr double kSteps[] = {1e-5, 1e-7, 1e-9, 1e-11}, kShare = 1e-4, kNoise = 1e-7;
  const std::size_t n = x.size();
  SumOfAll sum(functions, n, m);
  bool decided = false;
  for (const double step : kSteps) {
    std::vector<double> above = x, below = x, between(n);  // after rounding: the actual distance is used
    for (std::size_t j = 0; j < n; ++j) {
      const double by = step * (1.0 + std::abs(x[j])) / (1.0 + static_cast<double>(j % 7));
      above[j] += by, below[j] -= by;
      between[j] = above[j] - below[j];
    }
    const std::vector<double> ahead = sum.slope(above), behind = sum.slope(below),
                              product = sum.product(x, between);
    double most = 0.0, size = 0.0, apart = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      const double difference = ahead[j] - behind[j];
      most = std::max(most, std::abs(ahead[j]));
      size = std::max({size, std::abs(difference), std::abs(product[j])});
      apart += std::abs(difference - product[j]);
    }
    if (apart <= kShare * size + kNoise * 2.0 * step * (1.0 + most)) return true;
    decided |= std::isfinite(apart);
  }
  return !decided;
}

// Returns the file's start, within its bounds, or with `off` away from active ones; long defined variables
// start at their values. Returns nothing if nothing is at a bound.
std::optional<std::vector<double>> start_of(const ExpressionFile& file, AslFunctions& functions, bool off) {
  const auto given = static_cast<std::size_t>(file.header.variables),
             rows = static_cast<std::size_t>(file.header.constraints);
  std::vector<double> start = file.model.initial;
  start.resize(given + file.lifted.size(), 0.0);
  for (std::size_t j = 0; j < given; ++j) {
    const NlBounds& bounds = file.model.bounds[j];
    if (bounds.low <= bounds.high) start[j] = std::clamp(start[j], bounds.low, bounds.high);
  }
  if (off) {
    std::vector<double> lower, upper;
    for (const NlBounds& bounds : file.model.bounds)
      lower.push_back(bounds.low), upper.push_back(bounds.high);
    if (!nonlinear::leave_bounds(std::span(start).first(given), lower, upper)) return std::nullopt;
  }
  for (std::size_t k = 0; k < file.lifted.size(); ++k)
    start[given + k] = functions.row(rows + k, start);  // expression − variable
  return start;
}

// Checks that all functions have a value at the start; the error has the name of the first that has none.
Expected<void> check_start(const ExpressionFile& file, AslFunctions& functions, std::span<const double> start,
                           std::span<const double> rows, const NlNames& names) {
  const auto fault = [&](NlPlace place) {
    return unexpected(place.named(
        invalid("x", "must be a point where every function has a value: there is none at the initial point"),
        names));
  };
  const auto given = static_cast<std::size_t>(file.header.constraints);
  for (std::size_t k = 0; k < file.lifted.size(); ++k) {
    if (!std::isfinite(start[static_cast<std::size_t>(file.header.variables) + k]))
      return fault({NlPlace::Kind::definition, file.lifted[k]});
  }
  for (std::size_t i = 0; i < given; ++i) {
    if (!std::isfinite(rows[i])) return fault({NlPlace::Kind::row, static_cast<int>(i)});
  }
  if (!std::isfinite(functions.objective(start))) return fault({NlPlace::Kind::objective});
  return {};
}

}  // namespace

Expected<NlNonlinear> parse_nonlinear_nl(std::string_view content, const std::string& name,
                                         const NlNames& names) {
  MARBLE_ASSIGN_OR_RETURN(auto file, read_expressions(content, names));
  MARBLE_ASSIGN_OR_RETURN(auto functions, AslFunctions::open(file.content));
  const std::size_t m = file.model.row_bounds.size();
  std::vector<double> start, rows(m);
  Expected<void> begins;
  for (const bool off : {false, true}) {
    auto from = start_of(file, functions, off);
    if (!from) break;
    start = std::move(*from);
    functions.rows(start, rows);
    const auto there = check_start(file, functions, start, rows, names);
    if (!off || there) begins = there;  // keeps the first point's error
    if (begins) break;
  }
  if (!begins) return unexpected(begins.error());
  const std::size_t n = start.size();
  std::vector<double> beside = start;  // where fewer entries are zero
  for (std::size_t j = 0; j < n; ++j) beside[j] += 0.01 * (1.0 + static_cast<double>(j % 3));
  const bool trusted =
      second_derivatives_agree(functions, start, m) && second_derivatives_agree(functions, beside, m);
  start.insert(start.end(), rows.begin(), rows.end());
  file.model.initial = std::move(start);
  file.model.bounds_apart = true;
  MARBLE_ASSIGN_OR_RETURN(auto linear, as_lcqp(std::move(file.model), name, names));

  NlNonlinear made;
  made.variables = file.header.variables, made.constraints = file.header.constraints;
  made.name = name, made.names = names, made.maximize = linear.file.maximize;
  made.row_duals = std::move(linear.row_duals), made.reduced_costs = std::move(linear.reduced_costs);
  std::erase_if(made.row_duals, [&](const DualTerm& term) { return term.of >= made.constraints; });
  OwnedProblem& blocks = linear.file.problem;
  made.equalities = blocks.b.size(), made.inequalities = blocks.d.size(), made.pairs = blocks.l.size();
  made.problem.start = std::move(blocks.initial_z);
  const auto first_row = made.problem.start.begin() + static_cast<std::ptrdiff_t>(n);
  made.problem.start.erase(first_row, first_row + static_cast<std::ptrdiff_t>(m));
  made.problem.lower.assign(made.problem.start.size(), -kInfinity);
  made.problem.upper.assign(made.problem.start.size(), kInfinity);
  for (std::size_t j = 0; j < n; ++j)
    std::tie(made.problem.lower[j], made.problem.upper[j]) = linear.bounds[j];
  const auto all = std::make_shared<FileFunctions>(std::move(functions), std::move(blocks), n, m, made.sign(),
                                                   made.problem.start);
  made.problem.values = [all](std::span<const double> x) { return all->values(x); };
  made.problem.derivatives = [all](std::span<const double> x) { return all->derivatives(x); };
  if (!trusted) return made;
  made.problem.hessian = [all](std::span<const double> x, const nonlinear::Multipliers& multipliers) {
    return all->hessian(x, multipliers);
  };
  return made;
}

Error NlNonlinear::named(Error error) const {
  const std::size_t dot = error.field.find('.');
  const std::string part = dot == std::string::npos ? "" : error.field.substr(dot + 1);
  if (part == "objective" || part == "gradient" || error.field == "hessian")
    return part.empty() ? error : NlPlace{NlPlace::Kind::objective}.named(std::move(error), names);
  const std::pair<const char*, Block> parts[] = {{"equalities", Block::equality},
                                                 {"inequalities", Block::inequality},
                                                 {"G", Block::left},
                                                 {"H", Block::right}};
  for (const auto& [field, block] : parts) {
    if (part != field) continue;
    const auto whose = std::ranges::find_if(row_duals, [&, of = block](const DualTerm& term) {
      return term.block == of && term.index == error.index;
    });
    if (whose != row_duals.end())
      return NlPlace{NlPlace::Kind::row, whose->of}.named(std::move(error), names);
  }
  return error;
}

MultiplierView multipliers_of(const nonlinear::Answer& answer) {
  const nonlinear::Multipliers& m = answer.multipliers;
  return {m.equalities, m.inequalities, m.G, m.H};
}

}  // namespace marble::formats
