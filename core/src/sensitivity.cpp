#include "marble/sensitivity.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <string>
#include <utility>

#include "branch/branch_point.h"
#include "marble/solver.h"
#include "tuning.h"

namespace marble {
namespace {

using Numbers = std::vector<double>;

// out += M x, and with the transpose: M of a view's pattern with these values.
void add_product(const SparseMatrixView& m, std::span<const double> values, const Vector& x, Vector& out,
                 Index first = 0) {
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out[first + m.row_indices[k]] += values[k] * x[j];
  }
}
void add_transposed_product(const SparseMatrixView& m, std::span<const double> values, const Vector& y,
                            Vector& out, Index first = 0) {
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out[j] += values[k] * y[first + m.row_indices[k]];
  }
}
void add_symmetric_product(const SparseMatrixView& m, std::span<const double> values, const Vector& x,
                           Vector& out) {
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
      const Index i = m.row_indices[k];
      if (i > j) continue;
      out[i] += values[k] * x[j];
      if (i != j) out[j] += values[k] * x[i];
    }
  }
}

// By each stored entry of a matrix whose product with x enters the rows `first` on, and whose transpose's
// with y enters the stationarity.
Numbers by_entry(const SparseMatrixView& m, const Vector& x, const Vector& y, const Vector& a_x,
                 const Vector& a_y, Index first = 0) {
  Numbers gradient(m.values.size());
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
      const Index i = first + m.row_indices[k];
      gradient[k] = -(a_y[i] * x[j] + y[i] * a_x[j]);
    }
  }
  return gradient;
}
Numbers by_upper_entry(const SparseMatrixView& m, const Vector& x, const Vector& a) {
  Numbers gradient(m.values.size());
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
      const Index i = m.row_indices[k];
      if (i < j) gradient[k] = -(a[i] * x[j] + a[j] * x[i]);
      if (i == j) gradient[k] = -a[i] * x[i];
    }
  }
  return gradient;
}

void add_to(std::span<const double> values, double factor, Vector& out, Index first = 0) {
  for (std::size_t i = 0; i < values.size(); ++i) out[first + static_cast<Index>(i)] += factor * values[i];
}

Numbers part(const Vector& values, Index first, Index count, double factor) {
  Numbers result(static_cast<std::size_t>(count));
  for (Index i = 0; i < count; ++i) result[static_cast<std::size_t>(i)] = factor * values[first + i];
  return result;
}

Error no_branch(const char* why) { return failure(ErrorCode::failed_precondition, "solution", why); }

Expected<void> check_answer(const Solution& answer, const PartSizes& sizes) {
  if (auto valid = check_warm_start(answer, sizes); !valid) {
    const std::string& field = valid.error().field;
    return unexpected(of_field("solution" + field.substr(field.find('.')), valid.error()));
  }
  if (!is_solved(answer.status))
    return unexpected(no_branch((std::string("must be solved: it is ") + to_string(answer.status)).c_str()));
  return {};
}

}  // namespace

/// Vectors of the system, in the user's units: of its variables, and of its right-hand side.
struct Kinds {
  explicit Kinds(const ScaledProblem& p)
      : z(Vector::Zero(p.variables())),
        y(Vector::Zero(p.equalities())),
        lambda(Vector::Zero(p.layout.size())) {}
  Vector z, y, lambda;
};

struct Sensitivity::State {
  State(const Problem& user_problem, ScaledProblem scaled_problem)
      : problem(user_problem.view()),
        sizes(PartSizes::of(user_problem)),
        scaled(std::move(scaled_problem)),
        kkt(make_kkt(scaled)),
        point(scaled, *kkt),
        right(scaled),
        found(scaled),
        answer(scaled) {}

  [[nodiscard]] Expected<void> begin(const Solution& solution);
  void find_weak_rows();
  [[nodiscard]] bool solve(const Kinds& right_hand_side, Kinds& solution);
  [[nodiscard]] bool holds(const Kinds& change);
  [[nodiscard]] Kinds unscaled(const Iterate& x) const;

  ProblemView problem;
  PartSizes sizes;
  ScaledProblem scaled;
  std::unique_ptr<Kkt> kkt;
  BranchPoint point;
  Iterate right, found;  // of the scaled system
  Kinds answer;
  std::vector<Index> weak_inequalities, biactive_pairs;
  std::vector<Index> weak_rows;  // of both, by their number in [C; L; R]
};

Kinds Sensitivity::State::unscaled(const Iterate& x) const {
  Kinds kinds(scaled);
  kinds.z = x.z().cwiseProduct(scaled.variable_scale);
  kinds.y = x.y().cwiseProduct(scaled.equality_scale) / scaled.cost_scale;
  kinds.lambda = x.lambda().cwiseProduct(scaled.row_scale) / scaled.cost_scale;
  return kinds;
}

Expected<void> Sensitivity::State::begin(const Solution& solution) {
  marble::take(scaled, solution, right);
  point.start_from_solution(right);
  const Options options;
  Run run(options, {});
  if (!point.factor(run, tuning::exact_rho, tuning::exact_delta))
    return unexpected(no_branch("lies where its branch is not convex"));
  if (!point.sharpen(tuning::rounding) || point.error() > tuning::exactness * (1.0 + max_abs(point.x.all)))
    return unexpected(no_branch("is no exact solution of a branch"));
  answer = unscaled(point.x);
  weak_inequalities.clear(), biactive_pairs.clear(), weak_rows.clear();
  find_weak_rows();
  return {};
}

void Sensitivity::State::find_weak_rows() {
  const WorkingSet& set = point.set;
  const Vector& value = point.images.rows.all;
  const auto lambda = point.x.lambda();
  const double least = tuning::near * (1.0 + max_abs(point.x.lambda()));
  const auto pulls = [&](Index row) { return set.held[row] && lambda[row] < -least; };
  const auto zero = [&](Index row) { return set.held[row] || value[row] <= tuning::near; };
  for (Index row = 0; row < scaled.inequalities(); ++row) {
    if (!zero(row) || pulls(row)) continue;
    weak_inequalities.push_back(row);
    weak_rows.push_back(row);
  }
  for (Index pair = 0; pair < scaled.pairs(); ++pair) {
    const Index fixed = set.fixed_row(pair), free = set.free_row(pair);
    if (!zero(free) || (pulls(fixed) && pulls(free))) continue;
    biactive_pairs.push_back(pair);
    std::ranges::copy_if(std::initializer_list<Index>{fixed, free}, std::back_inserter(weak_rows),
                         [&](Index row) { return !pulls(row); });
  }
}

// K x = right-hand side in the scaled system, K̄ = S K S with S = (√c D, E/√c) up to the cost.
bool Sensitivity::State::solve(const Kinds& right_hand_side, Kinds& solution) {
  right.all.setZero();
  right.z() = scaled.cost_scale * right_hand_side.z.cwiseProduct(scaled.variable_scale);
  right.y() = right_hand_side.y.cwiseProduct(scaled.equality_scale);
  right.lambda() = right_hand_side.lambda.cwiseProduct(scaled.row_scale);
  if (!point.solve(right, found)) return false;
  solution = unscaled(found);
  return true;
}

// Of the change that was found last, scaled: a row that is held may only be pulled on more, one that is not
// may only open. Of a biactive pair the fixed side too.
bool Sensitivity::State::holds(const Kinds& change) {
  const double noise = tuning::near * (1.0 + max_abs(found.all));
  Images moved(scaled);
  moved.evaluate_rows(scaled, found.z());
  const auto& offset = change.lambda;  // of the direction: what the rows change by themselves
  return std::ranges::all_of(weak_rows, [&](Index row) {
    if (point.set.held[row]) return found.lambda()[row] <= noise;
    return moved.rows.all[row] + scaled.row_scale[row] * offset[row] >= -noise;
  });
}

Sensitivity::Sensitivity(std::unique_ptr<State> state) : state_(std::move(state)) {}
Sensitivity::Sensitivity(Sensitivity&&) noexcept = default;
Sensitivity& Sensitivity::operator=(Sensitivity&&) noexcept = default;
Sensitivity::~Sensitivity() = default;

Expected<Sensitivity> Sensitivity::create(const Problem& problem, const Solution& answer) {
  if (auto valid = check_answer(answer, PartSizes::of(problem)); !valid) return unexpected(valid.error());
  auto state = std::make_unique<State>(problem, scale(problem, Options().scaling_passes));
  if (auto begun = state->begin(answer); !begun) return unexpected(begun.error());
  return Sensitivity(std::move(state));
}

Expected<void> Sensitivity::renew(const ProblemUpdate& update, const Solution& answer) {
  if (auto valid = state_->sizes.check(update); !valid) return valid;
  if (auto valid = check_answer(answer, state_->sizes); !valid) return valid;
  if (rescale(update, state_->scaled)) state_->kkt->load(state_->scaled);
  return state_->begin(answer);
}

Expected<AnswerChange> Sensitivity::along(const ProblemUpdate& direction) {
  State& s = *state_;
  if (auto valid = s.sizes.check(direction); !valid) return unexpected(inside("direction", valid.error()));
  const ProblemView& p = s.problem;
  const Index n_i = s.scaled.inequalities(), n_c = s.scaled.pairs();
  Kinds change(s.scaled), at(s.scaled);  // of the rows by the direction alone; of the answer
  add_to(direction.g, 1.0, change.z), add_to(direction.b, 1.0, change.y);
  add_to(direction.d, 1.0, change.lambda), add_to(direction.l, 1.0, change.lambda, n_i);
  add_to(direction.r, 1.0, change.lambda, n_i + n_c);
  const Kinds& x = s.answer;
  if (!direction.Q.empty()) add_symmetric_product(p.Q, direction.Q, x.z, change.z);
  const auto add = [&](const SparseMatrixView& m, std::span<const double> values, const Vector& multipliers,
                       Vector& rows, Index first) {
    if (values.empty()) return;
    add_product(m, values, x.z, rows, first);
    add_transposed_product(m, values, multipliers, change.z, first);
  };
  add(p.A, direction.A, x.y, change.y, 0), add(p.C, direction.C, x.lambda, change.lambda, 0);
  add(p.L, direction.L, x.lambda, change.lambda, n_i);
  add(p.R, direction.R, x.lambda, change.lambda, n_i + n_c);
  Kinds minus(s.scaled);
  minus.z = -change.z, minus.y = -change.y, minus.lambda = -change.lambda;
  if (!s.solve(minus, at)) {
    return unexpected(
        failure(ErrorCode::failed_precondition, "direction",
                "the rows of the answer's branch contradict each other along it, or it is flat"));
  }
  return AnswerChange{.z = part(at.z, 0, s.scaled.variables(), 1.0),
                      .equality_multipliers = part(at.y, 0, s.scaled.equalities(), 1.0),
                      .inequality_multipliers = part(at.lambda, 0, n_i, -1.0),
                      .complementarity_multipliers_L = part(at.lambda, n_i, n_c, -1.0),
                      .complementarity_multipliers_R = part(at.lambda, n_i + n_c, n_c, -1.0),
                      .holds = s.holds(change)};
}

// K is symmetric: wᵀ K⁻¹ (−∂F/∂p) = −aᵀ ∂F/∂p with K a = w.
Expected<ProblemGradient> Sensitivity::gradient(const AnswerWeights& weights) {
  State& s = *state_;
  const Index n_i = s.scaled.inequalities(), n_c = s.scaled.pairs();
  Kinds w(s.scaled), a(s.scaled);
  struct Part {
    std::span<const double> values;
    std::size_t size;
    const char* field;
    double sign;
    Vector& out;
    Index first;
  };
  for (const Part& given :
       {Part{weights.z, s.sizes.g, "weights.z", 1.0, w.z, 0},
        Part{weights.equality_multipliers, s.sizes.b, "weights.equality_multipliers", 1.0, w.y, 0},
        Part{weights.inequality_multipliers, s.sizes.d, "weights.inequality_multipliers", -1.0, w.lambda, 0},
        Part{weights.complementarity_multipliers_L, s.sizes.l, "weights.complementarity_multipliers_L", -1.0,
             w.lambda, n_i},
        Part{weights.complementarity_multipliers_R, s.sizes.r, "weights.complementarity_multipliers_R", -1.0,
             w.lambda, n_i + n_c}}) {
    if (given.values.empty()) continue;
    if (auto valid = check_numbers(given.values, given.size, given.field); !valid)
      return unexpected(valid.error());
    add_to(given.values, given.sign, given.out, given.first);
  }
  for (Index row = 0; row < w.lambda.size(); ++row) {
    if (s.point.set.held[row] == 0) w.lambda[row] = 0.0;  // its multiplier stays zero
  }
  if (!s.solve(w, a)) {
    return unexpected(failure(ErrorCode::failed_precondition, "weights",
                              "the multipliers of the answer's branch are not unique, or it is flat"));
  }
  const ProblemView& p = s.problem;
  const Kinds& x = s.answer;
  return ProblemGradient{.g = part(a.z, 0, s.scaled.variables(), -1.0),
                         .b = part(a.y, 0, s.scaled.equalities(), -1.0),
                         .d = part(a.lambda, 0, n_i, -1.0),
                         .l = part(a.lambda, n_i, n_c, -1.0),
                         .r = part(a.lambda, n_i + n_c, n_c, -1.0),
                         .Q = by_upper_entry(p.Q, x.z, a.z),
                         .A = by_entry(p.A, x.z, x.y, a.z, a.y),
                         .C = by_entry(p.C, x.z, x.lambda, a.z, a.lambda),
                         .L = by_entry(p.L, x.z, x.lambda, a.z, a.lambda, n_i),
                         .R = by_entry(p.R, x.z, x.lambda, a.z, a.lambda, n_i + n_c)};
}

const std::vector<Index>& Sensitivity::weak_inequalities() const { return state_->weak_inequalities; }
const std::vector<Index>& Sensitivity::biactive_pairs() const { return state_->biactive_pairs; }

}  // namespace marble
