#include "branch/branch_derivatives.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "model/tuning.h"

namespace marble {
namespace {

using Numbers = std::vector<double>;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

Error no_branch(std::string why) {
  return failure(ErrorCode::failed_precondition, "solution", std::move(why));
}

Expected<void> unless_over(const Run& run) {
  if (!run.interrupt().requested()) return {};
  return unexpected(no_branch(run.interrupt().stop_requested()
                                  ? "was stopped before its derivatives were there"
                                  : "was there, but no time for its derivatives"));
}

Numbers numbers(ConstVectorRef values) { return {values.data(), values.data() + values.size()}; }

void forget(std::size_t number, std::size_t size, Numbers& of) {
  std::fill_n(of.begin() + static_cast<std::ptrdiff_t>(number * size), size,
              std::numeric_limits<double>::quiet_NaN());
}

bool is_finite(std::size_t number, std::size_t size, const Numbers& of) {
  const auto first = of.begin() + static_cast<std::ptrdiff_t>(number * size);
  return std::all_of(first, first + static_cast<std::ptrdiff_t>(size),
                     [](double value) { return std::isfinite(value); });
}

// Subtracts a diagonal matrix from Q, in the problem and in the Kkt, for the lifetime of this object.
class WithoutDiagonal {
 public:
  WithoutDiagonal(ScaledProblem& problem, BranchPoint& point, BranchSystemMemory& memory)
      : problem_(problem), point_(point), memory_(memory) {}
  WithoutDiagonal(const WithoutDiagonal&) = delete;
  WithoutDiagonal& operator=(const WithoutDiagonal&) = delete;
  ~WithoutDiagonal() {
    problem_.Q.values.swap(values_);
    point_.kkt().load(problem_);
    point_.forget_factor();
    memory_.forget_branch();
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
    memory_.forget_branch();
    return {};
  }

 private:
  ScaledProblem& problem_;
  BranchPoint& point_;
  BranchSystemMemory& memory_;
  std::vector<double> values_;  // original values of Q
};

}  // namespace

Expected<void> must_be_solved(Status status) {
  if (is_solved(status)) return {};
  return unexpected(no_branch(std::string("must be solved: it is ") + to_string(status)));
}

BranchDerivatives::BranchDerivatives(ScaledProblem& problem, const PartSizes& sizes, BranchPoint& point)
    : problem_(problem), sizes_(sizes), point_(point) {}

Expected<void> BranchDerivatives::factor(Run& run) {
  if (point_.factor(run, tuning::exact_rho, tuning::exact_delta)) return {};
  MARBLE_RETURN_IF_ERROR(unless_over(run));
  return unexpected(no_branch("lies where its branch is not convex"));
}

// Restores the factor, which another engine or another Q may have replaced. Fails if the run is over.
Expected<void> BranchDerivatives::make_ready(Run& run) {
  MARBLE_RETURN_IF_ERROR(unless_over(run));
  return point_.has_factor(tuning::exact_rho, tuning::exact_delta) ? Expected<void>() : factor(run);
}

// Also holds a free side at zero whose multiplier has the wrong sign. Otherwise the branch's solution would
// differ from the given solution.
void BranchDerivatives::hold_wrong_signs(const Iterate& solution) {
  const auto lambda = solution.lambda();
  const double least = tuning::near * (1.0 + max_abs(lambda));
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const Index free = point_.set.free_row(pair);
    if (point_.set.held[free] != 0 || lambda[free] <= least) continue;
    if (point_.images.rows.all[free] > tuning::near) continue;
    point_.set.held[free] = 1;
    point_.x.lambda()[free] = lambda[free];
  }
}

Expected<void> BranchDerivatives::begin(Run& run, const Iterate& solution, bool may_reuse_factor) {
  point_.start_from_solution(solution);
  hold_wrong_signs(solution);
  if (!may_reuse_factor || !point_.has_factor(tuning::exact_rho, tuning::exact_delta)) {
    MARBLE_RETURN_IF_ERROR(factor(run));
  }
  if (!point_.sharpen(tuning::rounding) ||
      point_.error() > tuning::exactness * (1.0 + max_abs(point_.x.all))) {
    MARBLE_RETURN_IF_ERROR(unless_over(run));
    return unexpected(no_branch("is no exact solution of a branch"));
  }
  memory_.forget_branch();
  const Iterate& x = point_.x;
  x_z_ = x.z().cwiseProduct(problem_.variable_scale);
  x_y_ = x.y().cwiseProduct(problem_.equality_scale) / problem_.cost_scale;
  x_lambda_ = x.lambda().cwiseProduct(problem_.row_scale) / problem_.cost_scale;
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

// Decides whether the active set stays constant. A held row's multiplier may only grow in its own sign, and
// the value of a row that is not held may only grow. The same applies to the fixed side of a biactive pair.
// `by_direction` contains the effect of the direction itself on the weak rows.
template <class T>
void BranchDerivatives::report_constant_active_sets(const BranchSystem<T>& system,
                                                    const std::vector<T>& by_direction, const Batch<T>& batch,
                                                    std::vector<std::uint8_t>& active_set_constant) const {
  if (weak_rows_.empty()) return;
  const T largest = system.largest();
  for (std::size_t k = 0; k < weak_rows_.size(); ++k) {
    const Index row = weak_rows_[k];
    const bool held = point_.set.held[row] != 0;
    const T room = held ? -system.lambda[row] : by_direction[k] + row_product(problem_.rows, row, system.z);
    batch.for_each([&](int i) {
      if (lane(room, i) < -tuning::near * (1.0 + lane(largest, i)))
        active_set_constant[at(batch.number(i))] = 0;
    });
  }
}

// F is linear in the numbers. Its derivative along a direction is F with the direction's numbers, evaluated
// at the solution: first in the user's units, then scaled like F.
template <class T>
void BranchDerivatives::take_directions(const ProblemUpdate& by, const Batch<T>& batch,
                                        BranchSystem<T>& system) const {
  system.clear();
  const auto vector = [&](std::span<const double> values, std::size_t size, T* out) {
    if (values.empty()) return;
    for (Index i = 0; i < static_cast<Index>(size); ++i) out[i] = batch.read(values, size, i);
  };
  const auto rows = [&](const RowMatrix& m, std::span<const double> values, std::size_t size, Index first,
                        Index count, const Vector& multipliers, T* out) {
    if (values.empty()) return;
    for (Index row = first; row < first + count; ++row) {
      for (Index k = m.row_pointers[row]; k < m.row_pointers[row + 1]; ++k) {
        const Index j = m.column_indices[k];
        const T value = batch.read(values, size, m.source[k]);
        out[row] += x_z_[j] * value;
        system.right_z[j] += multipliers[row] * value;
      }
    }
  };
  const RowLayout& layout = problem_.layout;
  vector(by.g, sizes_.g, system.right_z);
  vector(by.b, sizes_.b, system.right_y);
  vector(by.d, sizes_.d, system.right_lambda);
  vector(by.l, sizes_.l, system.right_lambda + layout.s(0));
  vector(by.r, sizes_.r, system.right_lambda + layout.t(0));
  rows(problem_.A, by.A, sizes_.A, 0, problem_.equalities(), x_y_, system.right_y);
  rows(problem_.rows, by.C, sizes_.C, 0, layout.inequalities, x_lambda_, system.right_lambda);
  rows(problem_.rows, by.L, sizes_.L, layout.s(0), layout.pairs, x_lambda_, system.right_lambda);
  rows(problem_.rows, by.R, sizes_.R, layout.t(0), layout.pairs, x_lambda_, system.right_lambda);
  if (!by.Q.empty()) {
    const SymmetricMatrix& Q = problem_.Q;
    for (Index j = 0; j < Q.size; ++j) {
      for (Index k = Q.column_pointers[j]; k < Q.column_pointers[j + 1]; ++k) {
        const Index i = Q.row_indices[k];
        const T value = batch.read(by.Q, sizes_.Q, Q.source[k]);
        system.right_z[i] += x_z_[j] * value;
        if (i != j) system.right_z[j] += x_z_[i] * value;
      }
    }
  }
  const auto scale = [](T* out, double factor, const Vector& factors) {
    for (Eigen::Index i = 0; i < factors.size(); ++i) out[i] *= factor * factors[i];
  };
  scale(system.right_z, -problem_.cost_scale, problem_.variable_scale);
  scale(system.right_y, -1.0, problem_.equality_scale);
  scale(system.right_lambda, -1.0, problem_.row_scale);
}

template <class T>
void BranchDerivatives::find_changes(const ProblemUpdate& by, const Batch<T>& batch, AnswerChanges& changes) {
  BranchSystem<T> system(problem_, point_, memory_);
  take_directions(by, batch, system);
  std::vector<T> by_direction;
  for (const Index row : weak_rows_) by_direction.push_back(-system.right_lambda[row]);
  const auto solved = system.solve(batch.count());
  report_constant_active_sets(system, by_direction, batch, changes.active_set_constant);
  const auto report = [&](const T* values, double factor, const auto& scale, Numbers& to, std::size_t size) {
    for (Index i = 0; i < static_cast<Index>(size); ++i)
      batch.write((factor * scale[i]) * values[i], to, size, i);
  };
  const RowLayout& rows = problem_.layout;
  const Vector& row_scale = problem_.row_scale;
  const double cost = 1.0 / problem_.cost_scale;
  report(system.z, 1.0, problem_.variable_scale, changes.z, sizes_.g);
  report(system.y, cost, problem_.equality_scale, changes.equality_multipliers, sizes_.b);
  report(system.lambda, -cost, row_scale, changes.inequality_multipliers, sizes_.d);
  report(system.lambda + rows.s(0), -cost, rows.s_part(row_scale), changes.complementarity_multipliers_L,
         sizes_.l);
  report(system.lambda + rows.t(0), -cost, rows.t_part(row_scale), changes.complementarity_multipliers_R,
         sizes_.r);
  batch.for_each([&](int i) {
    const std::size_t number = at(batch.number(i));
    if (solved[at(i)] && is_finite(number, sizes_.g, changes.z) &&
        is_finite(number, sizes_.b, changes.equality_multipliers) &&
        is_finite(number, sizes_.d, changes.inequality_multipliers) &&
        is_finite(number, sizes_.l, changes.complementarity_multipliers_L) &&
        is_finite(number, sizes_.r, changes.complementarity_multipliers_R))
      return;
    changes.undefined.push_back(batch.number(i));
    changes.active_set_constant[number] = 0;
    forget(number, sizes_.g, changes.z);
    forget(number, sizes_.b, changes.equality_multipliers);
    forget(number, sizes_.d, changes.inequality_multipliers);
    forget(number, sizes_.l, changes.complementarity_multipliers_L);
    forget(number, sizes_.r, changes.complementarity_multipliers_R);
  });
}

Expected<AnswerChanges> BranchDerivatives::along(Run& run, const DirectionsRequest& directions) {
  MARBLE_RETURN_IF_ERROR(make_ready(run));
  const std::size_t count = at(directions.count);
  AnswerChanges changes{Numbers(count * sizes_.g),
                        Numbers(count * sizes_.b),
                        Numbers(count * sizes_.d),
                        Numbers(count * sizes_.l),
                        Numbers(count * sizes_.r),
                        std::vector<std::uint8_t>(count, 1),
                        {}};
  const bool ended = !in_batches(directions.count, [&](const auto& batch) {
    find_changes(directions.numbers, batch, changes);
    return unless_over(run).has_value();
  });
  if (ended) return unexpected(unless_over(run).error());
  return changes;
}

template <class T>
void BranchDerivatives::take_losses(const AnswerWeights& weights, const Batch<T>& batch,
                                    BranchSystem<T>& system) const {
  system.clear();
  const auto take = [&](std::span<const double> values, double factor, const auto& scale, T* out) {
    if (values.empty()) return;
    for (Index i = 0; i < static_cast<Index>(scale.size()); ++i)
      out[i] = (factor * scale[i]) * batch.read(values, at(static_cast<Index>(scale.size())), i);
  };
  const RowLayout& rows = problem_.layout;
  const Vector& scale = problem_.row_scale;
  take(weights.z, problem_.cost_scale, problem_.variable_scale, system.right_z);
  take(weights.equality_multipliers, 1.0, problem_.equality_scale, system.right_y);
  take(weights.inequality_multipliers, -1.0, rows.inequality_part(scale), system.right_lambda);
  take(weights.complementarity_multipliers_L, -1.0, rows.s_part(scale), system.right_lambda + rows.s(0));
  take(weights.complementarity_multipliers_R, -1.0, rows.t_part(scale), system.right_lambda + rows.t(0));
}

// K is symmetric: with K a = w the loss changes by wᵀK⁻¹(−∂F/∂p) = −aᵀ∂F/∂p. Each stored entry of a row
// contributes twice: its product with z to the rows, and that of its transpose with λ to the stationarity.
template <class T>
void BranchDerivatives::find_gradients(const AnswerWeights& weights, const Batch<T>& batch,
                                       ProblemGradients& gradients) {
  BranchSystem<T> system(problem_, point_, memory_);
  take_losses(weights, batch, system);
  const auto solved = system.solve(batch.count());
  const auto unscale = [](T* values, double factor, const Vector& factors) {
    for (Eigen::Index i = 0; i < factors.size(); ++i) values[i] *= factor * factors[i];
  };
  const double cost = 1.0 / problem_.cost_scale;
  unscale(system.z, -1.0, problem_.variable_scale);
  unscale(system.y, -cost, problem_.equality_scale);
  unscale(system.lambda, -cost, problem_.row_scale);
  const auto report = [&](const T* values, Numbers& to, std::size_t size) {
    for (Index i = 0; i < static_cast<Index>(size); ++i) batch.write(values[i], to, size, i);
  };
  const auto report_rows = [&](const RowMatrix& m, Index first, Index count, const Vector& multipliers,
                               const T* a, Numbers& to, std::size_t size) {
    for (Index row = first; row < first + count; ++row) {
      if (&m == &problem_.rows && point_.set.held[row] == 0) continue;  // its multiplier stays zero
      for (Index k = m.row_pointers[row]; k < m.row_pointers[row + 1]; ++k) {
        const Index j = m.column_indices[k];
        batch.write(x_z_[j] * a[row] + multipliers[row] * system.z[j], to, size, m.source[k]);
      }
    }
  };
  const RowLayout& rows = problem_.layout;
  report(system.z, gradients.g, sizes_.g);
  report(system.y, gradients.b, sizes_.b);
  report(system.lambda, gradients.d, sizes_.d);
  report(system.lambda + rows.s(0), gradients.l, sizes_.l);
  report(system.lambda + rows.t(0), gradients.r, sizes_.r);
  report_rows(problem_.A, 0, problem_.equalities(), x_y_, system.y, gradients.A, sizes_.A);
  report_rows(problem_.rows, 0, rows.inequalities, x_lambda_, system.lambda, gradients.C, sizes_.C);
  report_rows(problem_.rows, rows.s(0), rows.pairs, x_lambda_, system.lambda, gradients.L, sizes_.L);
  report_rows(problem_.rows, rows.t(0), rows.pairs, x_lambda_, system.lambda, gradients.R, sizes_.R);
  const SymmetricMatrix& Q = problem_.Q;
  for (Index j = 0; j < Q.size; ++j) {
    for (Index k = Q.column_pointers[j]; k < Q.column_pointers[j + 1]; ++k) {
      const Index i = Q.row_indices[k];
      T value = x_z_[j] * system.z[i];
      if (i != j) value += x_z_[i] * system.z[j];
      batch.write(value, gradients.Q, sizes_.Q, Q.source[k]);
    }
  }
  batch.for_each([&](int i) {
    bool found = solved[at(i)];
#define MARBLE_VECTOR(letter, field) \
  found = found && is_finite(at(batch.number(i)), sizes_.letter, gradients.letter);
#define MARBLE_MATRIX(letter, field, values, vector) \
  found = found && is_finite(at(batch.number(i)), sizes_.letter, gradients.letter);
#include "marble/contract.def"
    if (found) return;
    gradients.undefined.push_back(batch.number(i));
#define MARBLE_VECTOR(letter, field) forget(at(batch.number(i)), sizes_.letter, gradients.letter);
#define MARBLE_MATRIX(letter, field, values, vector) \
  forget(at(batch.number(i)), sizes_.letter, gradients.letter);
#include "marble/contract.def"
  });
}

Expected<ProblemGradients> BranchDerivatives::gradients(Run& run, const LossesRequest& losses) {
  MARBLE_RETURN_IF_ERROR(make_ready(run));
  ProblemGradients gradients;
#define MARBLE_VECTOR(letter, field) gradients.letter.resize(at(losses.count) * sizes_.letter);
#define MARBLE_MATRIX(letter, field, values, vector) \
  gradients.letter.resize(at(losses.count) * sizes_.letter);
#include "marble/contract.def"
  const bool ended = !in_batches(losses.count, [&](const auto& batch) {
    find_gradients(losses.weights, batch, gradients);
    return unless_over(run).has_value();
  });
  if (ended) return unexpected(unless_over(run).error());
  return gradients;
}

Expected<RowResponse> BranchDerivatives::rows(Run& run, const RowsRequest& request) {
  if (request.proximal.empty()) {
    MARBLE_RETURN_IF_ERROR(make_ready(run));
    return respond(run, request);
  }
  WithoutDiagonal without(problem_, point_, memory_);
  MARBLE_RETURN_IF_ERROR(without.take(request.proximal));
  MARBLE_RETURN_IF_ERROR(factor(run));
  return respond(run, request);
}

// Computes the columns P Eᵀ of a batch of rows and their products with E.
template <class T>
bool BranchDerivatives::find_response(const RowMatrix& e, const Batch<T>& batch, RowResponse& response) {
  BranchSystem<T> system(problem_, point_, memory_);
  const Vector& scale = problem_.variable_scale;
  system.clear();
  for (int i = 0; i < lanes_of<T>; ++i) {
    const Index row = batch.number(i);
    for (Index k = e.row_pointers[row]; k < e.row_pointers[row + 1]; ++k) {
      const Index j = e.column_indices[k];
      set_lane(system.right_z[j], i, problem_.cost_scale * scale[j] * e.values[k]);
    }
  }
  const auto solved = system.solve(batch.count());
  if (!std::all_of(solved.begin(), solved.begin() + batch.count(), [](bool there) { return there; }))
    return false;
  for (Index j = 0; j < problem_.variables(); ++j) system.z[j] *= scale[j];
  for (Index i = 0; i < batch.number(0) + batch.count(); ++i) {
    const T sum = row_product(e, i, system.z);
    batch.for_each([&](int k) {
      const auto column = at(batch.number(k));
      if (at(i) <= column) response.response[at(i) + column * (column + 1) / 2] = lane(sum, k);
    });
  }
  if (!response.columns.empty()) {
    for (Index j = 0; j < problem_.variables(); ++j)
      batch.write(system.z[j], response.columns, at(problem_.variables()), j);
  }
  return true;
}

Expected<RowResponse> BranchDerivatives::respond(Run& run, const RowsRequest& request) {
  const Error flat = failure(ErrorCode::failed_precondition, "rows", "the answer's branch is flat along one");
  const Vector& scale = problem_.variable_scale;
  const Index n = problem_.variables(), m = request.E.rows;
  RowMatrix e;
  e.columns = n;
  append_rows(request.E, m, e);
  Vector z = x_z_, of_rows(m);
  multiply(e, z, of_rows);
  RowResponse response{.values = numbers(of_rows), .free = {}, .response = {}, .z = {}, .columns = {}};
  if (!request.g.empty() || !request.proximal.empty()) {
    BranchSystem<double> system(problem_, point_, memory_);
    system.clear();
    Vector gradient(n);
    multiply(problem_.Q, point_.x.z(), gradient);
    for (Index j = 0; j < n; ++j) {
      const double own =
          request.g.empty() ? problem_.g[j] : problem_.cost_scale * scale[j] * request.g[at(j)];
      system.right_z[j] = gradient[j] + own;
    }
    if (!system.solve(1)[0]) return unexpected(flat);
    for (Index j = 0; j < n; ++j) z[j] -= system.z[j] * scale[j];
    multiply(e, z, of_rows);
  }
  response.free = numbers(of_rows);
  response.response.resize(at(m) * (at(m) + 1) / 2);
  if (request.columns) {
    response.z = numbers(z);
    response.columns.resize(at(n) * at(m));
  }
  const bool found = in_batches(m, [&](const auto& batch) {
    return unless_over(run).has_value() && find_response(e, batch, response);
  });
  MARBLE_RETURN_IF_ERROR(unless_over(run));
  if (!found) return unexpected(flat);
  for (const Numbers* part :
       {&response.values, &response.free, &response.response, &response.z, &response.columns}) {
    if (!std::ranges::all_of(*part, [](double value) { return std::isfinite(value); }))
      return unexpected(failure(ErrorCode::failed_precondition, "rows", "the response overflows"));
  }
  return response;
}

// Rows without their proximal term come last because they replace the factor. If one part runs out of time,
// the whole request ends.
Expected<SensitivityAnswer> BranchDerivatives::answer(Run& run, const SensitivityRequest& request) {
  SensitivityAnswer answer;
  answer.weak_inequalities = weak_inequalities_;
  answer.biactive_pairs = biactive_pairs_;
  MARBLE_ASSIGN_OR_RETURN(answer.changes, along(run, request.directions));
  MARBLE_ASSIGN_OR_RETURN(answer.gradients, this->gradients(run, request.losses));
  if (request.rows) answer.rows = rows(run, *request.rows);
  MARBLE_RETURN_IF_ERROR(unless_over(run));
  return answer;
}

}  // namespace marble
