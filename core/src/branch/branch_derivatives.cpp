#include "branch/branch_derivatives.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "tuning.h"

namespace marble {
namespace {

using Numbers = std::vector<double>;

Error no_branch(std::string why) {
  return failure(ErrorCode::failed_precondition, "solution", std::move(why));
}

Expected<void> unless_over(const Run& run) {
  if (!run.interrupt().requested()) return {};
  return unexpected(no_branch(run.interrupt().stop_requested()
                                  ? "was stopped before its derivatives were there"
                                  : "was there, but no time for its derivatives"));
}

Numbers numbers(ConstVectorRef values, double factor = 1.0) {
  Numbers result(static_cast<std::size_t>(values.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i) result[static_cast<std::size_t>(i)] = factor * values[i];
  return result;
}

// Zeros, but for the numbers of a direction.
void take_direction(const ProblemUpdate& direction, ScaledProblem& p) {
  for (auto* values : {&p.Q.values, &p.A.values, &p.rows.values})
    std::fill(values->begin(), values->end(), 0.0);
  for (auto* values : {&p.g, &p.b, &p.offset}) values->setZero();
  static_cast<void>(rescale(direction, p));
}

// By each stored entry of `count` rows from `first` on, whose product with z enters the rows and whose
// transpose's with λ the stationarity: K is symmetric, so wᵀK⁻¹(−∂F/∂p) = −aᵀ∂F/∂p with K a = w.
Numbers by_entry(const RowMatrix& m, std::size_t entries, const Vector& z, const Vector& lambda,
                 const Vector& a_z, const Vector& a_lambda, Index first, Index count) {
  Numbers gradient(entries);
  for (Index row = first; row < first + count; ++row) {
    for (Index k = m.row_pointers[row]; k < m.row_pointers[row + 1]; ++k) {
      const Index j = m.column_indices[k];
      gradient[static_cast<std::size_t>(m.source[k])] = -(a_lambda[row] * z[j] + lambda[row] * a_z[j]);
    }
  }
  return gradient;
}

Numbers by_upper_entry(const SymmetricMatrix& m, std::size_t entries, const Vector& z, const Vector& a) {
  Numbers gradient(entries);
  for (Index j = 0; j < m.size; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
      const Index i = m.row_indices[k];
      gradient[static_cast<std::size_t>(m.source[k])] = i == j ? -a[i] * z[i] : -(a[i] * z[j] + a[j] * z[i]);
    }
  }
  return gradient;
}

// Number k of parts that stand one after the other.
std::span<const double> part_of(std::span<const double> values, Index k, std::size_t size) {
  return values.empty() ? values : values.subspan(static_cast<std::size_t>(k) * size, size);
}
ProblemUpdate part_of(const ProblemUpdate& numbers, Index k, const PartSizes& sizes) {
  ProblemUpdate part;
#define MARBLE_VECTOR(letter, field) part.letter = part_of(numbers.letter, k, sizes.letter);
#define MARBLE_MATRIX(letter, field, values, vector) part.letter = part_of(numbers.letter, k, sizes.letter);
#include "marble/contract.def"
  return part;
}
AnswerWeights part_of(const AnswerWeights& w, Index k, const PartSizes& sizes) {
  return {part_of(w.z, k, sizes.g), part_of(w.equality_multipliers, k, sizes.b),
          part_of(w.inequality_multipliers, k, sizes.d), part_of(w.complementarity_multipliers_L, k, sizes.l),
          part_of(w.complementarity_multipliers_R, k, sizes.r)};
}

void append(const Numbers& part, Numbers& all) { all.insert(all.end(), part.begin(), part.end()); }
void append(const AnswerChange& part, AnswerChanges& all) {
  append(part.z, all.z);
  append(part.equality_multipliers, all.equality_multipliers);
  append(part.inequality_multipliers, all.inequality_multipliers);
  append(part.complementarity_multipliers_L, all.complementarity_multipliers_L);
  append(part.complementarity_multipliers_R, all.complementarity_multipliers_R);
}
void append(const ProblemGradient& part, ProblemGradients& all) {
#define MARBLE_VECTOR(letter, field) append(part.letter, all.letter);
#define MARBLE_MATRIX(letter, field, values, vector) append(part.letter, all.letter);
#include "marble/contract.def"
}

// Q without a diagonal, in the problem and in the Kkt, as long as this lives.
class WithoutDiagonal {
 public:
  WithoutDiagonal(ScaledProblem& problem, BranchPoint& point) : problem_(problem), point_(point) {}
  WithoutDiagonal(const WithoutDiagonal&) = delete;
  WithoutDiagonal& operator=(const WithoutDiagonal&) = delete;
  ~WithoutDiagonal() {
    problem_.Q.values.swap(values_);
    point_.kkt().load(problem_);
    point_.forget_factor();
  }

  [[nodiscard]] Expected<void> take(std::span<const double> diagonal) {
    values_ = problem_.Q.values;
    for (Index j = 0; j < problem_.Q.size; ++j) {
      const double value = diagonal[static_cast<std::size_t>(j)];
      if (value == 0.0) continue;
      const Index last = problem_.Q.column_pointers[j + 1] - 1;
      if (last < problem_.Q.column_pointers[j] || problem_.Q.row_indices[last] != j) {
        return unexpected(Error{ErrorCode::failed_precondition, "rows.proximal", j, std::to_string(value),
                                "must be 0: Q has no entry there"});
      }
      const double scale = problem_.variable_scale[j];
      problem_.Q.values[static_cast<std::size_t>(last)] -= problem_.cost_scale * scale * scale * value;
    }
    point_.kkt().load(problem_);
    return {};
  }

 private:
  ScaledProblem& problem_;
  BranchPoint& point_;
  std::vector<double> values_;  // of Q, as it was
};

}  // namespace

Expected<void> must_be_solved(Status status) {
  if (is_solved(status)) return {};
  return unexpected(no_branch(std::string("must be solved: it is ") + to_string(status)));
}

BranchDerivatives::BranchDerivatives(ScaledProblem& problem, const PartSizes& sizes, BranchPoint& point)
    : problem_(problem), sizes_(sizes), point_(point), right_(problem), found_(problem), moved_(problem) {}

BranchDerivatives::Unscaled BranchDerivatives::unscaled(const Iterate& x) const {
  return {x.z().cwiseProduct(problem_.variable_scale),
          x.y().cwiseProduct(problem_.equality_scale) / problem_.cost_scale,
          x.lambda().cwiseProduct(problem_.row_scale) / problem_.cost_scale};
}

Expected<void> BranchDerivatives::factor(Run& run) {
  if (point_.factor(run, tuning::exact_rho, tuning::exact_delta)) return {};
  if (auto over = unless_over(run); !over) return over;
  return unexpected(no_branch("lies where its branch is not convex"));
}

// With the factor, which another engine or another Q may have taken away, unless the run is over.
Expected<void> BranchDerivatives::make_ready(Run& run) {
  if (auto over = unless_over(run); !over) return over;
  return point_.has_factor(tuning::exact_rho, tuning::exact_delta) ? Expected<void>() : factor(run);
}

Expected<void> BranchDerivatives::begin(Run& run, const Iterate& solution, bool may_reuse_factor) {
  point_.start_from_solution(solution);
  if (!may_reuse_factor || !point_.has_factor(tuning::exact_rho, tuning::exact_delta)) {
    if (auto factored = factor(run); !factored) return factored;
  }
  if (!point_.sharpen(tuning::rounding) ||
      point_.error() > tuning::exactness * (1.0 + max_abs(point_.x.all))) {
    if (auto over = unless_over(run); !over) return over;
    return unexpected(no_branch("is no exact solution of a branch"));
  }
  find_weak_rows();
  return {};
}

void BranchDerivatives::find_weak_rows() {
  weak_inequalities_.clear(), biactive_pairs_.clear(), weak_rows_.clear();
  const WorkingSet& set = point_.set;
  const Vector& value = point_.images.rows.all;
  const auto lambda = point_.x.lambda();
  const double least = tuning::near * (1.0 + max_abs(point_.x.lambda()));
  const auto pulls = [&](Index row) { return set.held[row] && lambda[row] < -least; };
  const auto zero = [&](Index row) { return set.held[row] || value[row] <= tuning::near; };
  for (Index row = 0; row < problem_.inequalities(); ++row) {
    if (!zero(row) || pulls(row)) continue;
    weak_inequalities_.push_back(row);
    weak_rows_.push_back(row);
  }
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const Index fixed = set.fixed_row(pair), free = set.free_row(pair);
    if (!zero(free) || (pulls(fixed) && pulls(free))) continue;
    biactive_pairs_.push_back(pair);
    std::ranges::copy_if(std::initializer_list<Index>{fixed, free}, std::back_inserter(weak_rows_),
                         [&](Index row) { return !pulls(row); });
  }
}

// Of the change that was found last: a row that is held may only be pulled on more, one that is not may only
// open. Of a biactive pair the fixed side too.
bool BranchDerivatives::holds(const Images& by_direction) {
  const double noise = tuning::near * (1.0 + max_abs(found_.all));
  return std::ranges::all_of(weak_rows_, [&](Index row) {
    if (point_.set.held[row]) return found_.lambda()[row] <= noise;
    return moved_.rows.all[row] + by_direction.rows.all[row] >= -noise;
  });
}

// F is linear in the numbers: its derivative along a direction is F itself of a problem made of its numbers.
Expected<AnswerChange> BranchDerivatives::along(Run& run, const ProblemUpdate& direction) {
  if (auto ready = make_ready(run); !ready) return unexpected(ready.error());
  if (!direction_) direction_ = problem_;
  take_direction(direction, *direction_);
  Images change(problem_);
  change.evaluate(*direction_, point_.x);
  right_.all.setZero();
  right_.z() = -change.stationarity;
  right_.y() = -change.equality;
  right_.lambda() = -change.rows.all;
  if (!point_.solve(right_, found_)) {
    return unexpected(
        failure(ErrorCode::failed_precondition, "direction",
                "the rows of the answer's branch contradict each other along it, or it is flat"));
  }
  moved_.evaluate_rows(problem_, found_.z());
  const Unscaled at = unscaled(found_);
  const RowLayout& rows = problem_.layout;
  return AnswerChange{.z = numbers(at.z),
                      .equality_multipliers = numbers(at.y),
                      .inequality_multipliers = numbers(rows.inequality_part(at.lambda), -1.0),
                      .complementarity_multipliers_L = numbers(rows.s_part(at.lambda), -1.0),
                      .complementarity_multipliers_R = numbers(rows.t_part(at.lambda), -1.0),
                      .holds = holds(change)};
}

Expected<ProblemGradient> BranchDerivatives::gradient(Run& run, const AnswerWeights& weights) {
  if (auto ready = make_ready(run); !ready) return unexpected(ready.error());
  const RowLayout& rows = problem_.layout;
  const double cost = problem_.cost_scale;
  right_.all.setZero();
  const auto take = [](std::span<const double> values, double factor, const auto& scale, auto out) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      out[at] = factor * values[i] * scale[at];
    }
  };
  take(weights.z, cost, problem_.variable_scale, right_.z());
  take(weights.equality_multipliers, 1.0, problem_.equality_scale, right_.y());
  const Vector& scale = problem_.row_scale;
  take(weights.inequality_multipliers, -1.0, rows.inequality_part(scale), right_.lambda_w());
  take(weights.complementarity_multipliers_L, -1.0, rows.s_part(scale), right_.lambda_L());
  take(weights.complementarity_multipliers_R, -1.0, rows.t_part(scale), right_.lambda_R());
  point_.set.clear_others(right_.lambda());  // their multipliers stay zero
  if (!point_.solve(right_, found_)) {
    return unexpected(failure(ErrorCode::failed_precondition, "weights",
                              "the multipliers of the answer's branch are not unique, or it is flat"));
  }
  const Unscaled x = unscaled(point_.x), a = unscaled(found_);
  const auto of_rows = [&](std::size_t entries, Index first, Index count) {
    return by_entry(problem_.rows, entries, x.z, x.lambda, a.z, a.lambda, first, count);
  };
  return ProblemGradient{.g = numbers(a.z, -1.0),
                         .b = numbers(a.y, -1.0),
                         .d = numbers(rows.inequality_part(a.lambda), -1.0),
                         .l = numbers(rows.s_part(a.lambda), -1.0),
                         .r = numbers(rows.t_part(a.lambda), -1.0),
                         .Q = by_upper_entry(problem_.Q, sizes_.Q, x.z, a.z),
                         .A = by_entry(problem_.A, sizes_.A, x.z, x.y, a.z, a.y, 0, problem_.A.rows),
                         .C = of_rows(sizes_.C, 0, rows.inequalities),
                         .L = of_rows(sizes_.L, rows.s(0), rows.pairs),
                         .R = of_rows(sizes_.R, rows.t(0), rows.pairs)};
}

Expected<RowResponse> BranchDerivatives::rows(Run& run, const RowsRequest& request) {
  if (request.proximal.empty()) {
    if (auto ready = make_ready(run); !ready) return unexpected(ready.error());
    return respond(run, request);
  }
  WithoutDiagonal without(problem_, point_);
  if (auto taken = without.take(request.proximal); !taken) return unexpected(taken.error());
  if (auto factored = factor(run); !factored) return unexpected(factored.error());
  return respond(run, request);
}

Expected<RowResponse> BranchDerivatives::respond(Run& run, const RowsRequest& request) {
  const Error flat = failure(ErrorCode::failed_precondition, "rows", "the answer's branch is flat along one");
  const Vector& scale = problem_.variable_scale;
  const Index n = problem_.variables(), m = request.E.rows;
  RowMatrix e;
  e.columns = n;
  append_rows(request.E, m, e);
  Vector z = point_.x.z().cwiseProduct(scale), of_rows(m);
  multiply(e, z, of_rows);
  RowResponse response{.values = numbers(of_rows), .free = {}, .response = {}, .z = {}, .columns = {}};
  if (!request.g.empty() || !request.proximal.empty()) {
    right_.all.setZero();
    Vector gradient(n);
    multiply(problem_.Q, point_.x.z(), gradient);
    for (Index j = 0; j < n; ++j) {
      const double own = request.g.empty()
                             ? problem_.g[j]
                             : problem_.cost_scale * scale[j] * request.g[static_cast<std::size_t>(j)];
      right_.z()[j] = gradient[j] + own;
    }
    if (!point_.solve(right_, found_)) return unexpected(flat);
    z -= found_.z().cwiseProduct(scale);
    multiply(e, z, of_rows);
  }
  response.free = numbers(of_rows);
  response.response.reserve(static_cast<std::size_t>(m) * (static_cast<std::size_t>(m) + 1) / 2);
  if (request.columns) {
    response.z = numbers(z);
    response.columns.reserve(static_cast<std::size_t>(n) * static_cast<std::size_t>(m));
  }
  Vector column(n);
  for (Index j = 0; j < m; ++j) {
    if (auto over = unless_over(run); !over) return unexpected(over.error());
    right_.all.setZero();
    for (Index k = e.row_pointers[j]; k < e.row_pointers[j + 1]; ++k)
      right_.z()[e.column_indices[k]] = problem_.cost_scale * scale[e.column_indices[k]] * e.values[k];
    if (!point_.solve(right_, found_)) return unexpected(flat);
    column = found_.z().cwiseProduct(scale);
    multiply(e, column, of_rows);
    response.response.insert(response.response.end(), of_rows.begin(), of_rows.begin() + j + 1);
    if (request.columns) response.columns.insert(response.columns.end(), column.begin(), column.end());
  }
  return response;
}

// Rows without their proximal term come last: they take the factor away. What ends one thing for want of time
// ends all.
Expected<SensitivityAnswer> BranchDerivatives::answer(Run& run, const SensitivityRequest& request) {
  SensitivityAnswer answer;
  answer.weak_inequalities = weak_inequalities_;
  answer.biactive_pairs = biactive_pairs_;
  for (Index k = 0; k < request.directions.count; ++k) {
    auto change = along(run, part_of(request.directions.numbers, k, sizes_));
    if (auto over = unless_over(run); !over) return unexpected(over.error());
    answer.changes.holds.push_back(change && change->holds);
    if (!change) {
      answer.changes.missing.push_back(k);
      change = no_change();
    }
    append(*change, answer.changes);
  }
  for (Index k = 0; k < request.losses.count; ++k) {
    auto gradient = this->gradient(run, part_of(request.losses.weights, k, sizes_));
    if (auto over = unless_over(run); !over) return unexpected(over.error());
    if (!gradient) {
      answer.gradients.missing.push_back(k);
      gradient = no_gradient();
    }
    append(*gradient, answer.gradients);
  }
  if (request.rows) answer.rows = rows(run, *request.rows);
  if (auto over = unless_over(run); !over) return unexpected(over.error());
  return answer;
}

AnswerChange BranchDerivatives::no_change() const {
  const auto none = [](std::size_t size) { return Numbers(size, std::numeric_limits<double>::quiet_NaN()); };
  return {none(sizes_.g), none(sizes_.b), none(sizes_.d), none(sizes_.l), none(sizes_.r), false};
}

ProblemGradient BranchDerivatives::no_gradient() const {
  ProblemGradient gradient;
  const auto none = [](std::size_t size) { return Numbers(size, std::numeric_limits<double>::quiet_NaN()); };
#define MARBLE_VECTOR(letter, field) gradient.letter = none(sizes_.letter);
#define MARBLE_MATRIX(letter, field, values, vector) gradient.letter = none(sizes_.letter);
#include "marble/contract.def"
  return gradient;
}

}  // namespace marble
