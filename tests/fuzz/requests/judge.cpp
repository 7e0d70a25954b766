#include "requests/judge.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "marble/convert.h"
#include "marble/convert_coupled.h"
#include "marble/convert_scenarios.h"
#include "requests/dense.h"
#include "requests/findings.h"
#include "support/brute_force.h"
#include "support/conflict_check.h"
#include "support/independent_check.h"

namespace marble::fuzz {
namespace {

using google::protobuf::FieldDescriptor;

constexpr double kRounding = 1e-13;  // of the largest term of a sum of few
constexpr double kFirstDigit = 0.1;  // of the largest term, whatever the data
constexpr double kRelative = 1e-5;   // of what a tolerance of 1e-6 leaves, in other units

// Documented as infinite, or NaN where `undefined` says so.
bool may_be_infinite(std::string_view field) {
  return field == "marble.v1.Solution.bound" || field == "marble.v1.OutOfSample.half_width" ||
         field == "marble.v1.Solution.reference_objective" ||  // that of the start
         field.starts_with("marble.v1.ProblemNumbers.") || field.starts_with("marble.v1.AnswerVectors.");
}

// Sums over a point that is not solved.
bool may_overflow(std::string_view field) {
  static constexpr std::string_view kSums[] = {"marble.v1.Solution.objective",
                                               "marble.v1.Solution.kkt_residual",
                                               "marble.v1.Violations.equality",
                                               "marble.v1.Violations.inequality",
                                               "marble.v1.Violations.complementarity",
                                               "marble.v1.CoupledOutcome.step",
                                               "marble.v1.CoupledOutcome.coupling_violation",
                                               "marble.v1.CoupledOutcome.blocks_objective",
                                               "marble.v1.CoupledOutcome.sweep_objective",
                                               "marble.v1.SampleAverageStage.objective",
                                               "marble.v1.OutOfSample.mean",
                                               "marble.v1.Solution.gap"};
  return std::ranges::find(kSums, field) != std::end(kSums);
}

void expect_finite(const google::protobuf::Message& message, bool solved) {
  const auto& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const int size = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < size; ++i) {
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        expect_finite(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                           : reflection.GetMessage(message, field),
                      solved);
      } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
        const double value = field->is_repeated() ? reflection.GetRepeatedDouble(message, field, i)
                                                  : reflection.GetDouble(message, field);
        if (std::isfinite(value) || may_be_infinite(field->full_name())) continue;
        if (!solved && may_overflow(field->full_name())) continue;
        std::fprintf(stderr, "%s[%d] = %g\n", field->full_name().c_str(), i, value);
        FUZZ_JUDGE(std::isfinite(value));
      }
    }
  }
}

bool is_friendly(std::span<const double> values) {
  return std::ranges::all_of(
      values, [](double v) { return v == 0.0 || (std::abs(v) >= 1e-3 && std::abs(v) <= 1e3); });
}

// Rows of M z + v, each with the size of its largest term.
struct Rows {
  Rows(const SparseMatrixView& m, std::span<const double> offset, std::span<const double> z)
      : value(offset.begin(), offset.end()), size(offset.size()) {
    for (std::size_t i = 0; i < size.size(); ++i) size[i] = std::abs(offset[i]);
    for (Index j = 0; j < m.columns && !m.values.empty(); ++j) {
      for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
        const auto i = static_cast<std::size_t>(m.row_indices[k]);
        value[i] += m.values[k] * z[static_cast<std::size_t>(j)];
        size[i] = std::max(size[i], std::abs(m.values[k] * z[static_cast<std::size_t>(j)]));
      }
    }
  }
  std::vector<double> value, size;
};

// The largest size, at least 1.
double largest(const std::vector<double>& values) {
  double size = 1.0;
  for (const double value : values) size = std::max(size, std::abs(value));
  return size;
}

struct Answer {
  Answer(const ProblemView& p, const Solution& reported)
      : x(reported),
        equalities(p.A, p.b, x.z),
        inequalities(p.C, p.d, x.z),
        left(p.L, p.l, x.z),
        right(p.R, p.r, x.z) {}
  const Solution& x;
  Rows equalities, inequalities, left, right;
};

// At most so large, and what rounding of the row's terms leaves.
bool within(double violation, double tolerance, double size) {
  return violation <= tolerance * (1.0 + 1e-9) + kRounding * size;
}

// `agreement`: of what blocks have in common, relative to the largest.
void expect_feasible(const Answer& a, const Options& options, double agreement) {
  const double loose = a.x.status == Status::solved ? 1.0 : 100.0;
  const double equality_tolerance =
      loose * (options.equality_tolerance + agreement * largest(a.equalities.size));
  for (std::size_t i = 0; i < a.equalities.value.size(); ++i)
    FUZZ_JUDGE(within(std::abs(a.equalities.value[i]), equality_tolerance, a.equalities.size[i]));
  for (std::size_t i = 0; i < a.inequalities.value.size(); ++i) {
    FUZZ_JUDGE(
        within(-a.inequalities.value[i], loose * options.inequality_tolerance, a.inequalities.size[i]));
  }
  for (std::size_t i = 0; i < a.left.value.size(); ++i) {
    const double apart = std::abs(std::min(a.left.value[i], a.right.value[i]));
    FUZZ_JUDGE(
        within(apart, loose * options.complementarity_tolerance, std::max(a.left.size[i], a.right.size[i])));
  }
}

// The reported violations and objective are those of the point.
void expect_reported(const ProblemView& p, const Answer& a, const testing::Verdict& verdict) {
  // The largest double stands for a number that overflowed.
  const auto overflowed = [&](double reported) {
    return !is_solved(a.x.status) && reported == std::numeric_limits<double>::max();
  };
  const auto expect_alike = [&](double reported, double own, const Rows& rows) {
    double size = 1.0;
    for (const double s : rows.size) size = std::max(size, s);
    if (!std::isfinite(own) || !std::isfinite(size) || overflowed(reported)) return;
    FUZZ_JUDGE_AT_MOST(std::abs(reported - own), 1e-9 * (size + std::abs(own)));
  };
  expect_alike(a.x.violations.equality, verdict.equality, a.equalities);
  expect_alike(a.x.violations.inequality, verdict.inequality, a.inequalities);
  Rows sides = a.left;
  sides.size.insert(sides.size.end(), a.right.size.begin(), a.right.size.end());
  expect_alike(a.x.violations.complementarity, verdict.complementarity, sides);
  double size = 1.0 + std::abs(p.c0);
  for (std::size_t j = 0; j < p.g.size(); ++j) size = std::max(size, std::abs(p.g[j] * a.x.z[j]));
  for (Index j = 0; j < p.Q.columns && !p.Q.values.empty(); ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      size = std::max(size, std::abs(p.Q.values[k] * a.x.z[static_cast<std::size_t>(j)] *
                                     a.x.z[static_cast<std::size_t>(p.Q.row_indices[k])]));
    }
  }
  if (std::isfinite(verdict.objective) && size < 1e300 && !overflowed(a.x.objective))
    FUZZ_JUDGE_AT_MOST(std::abs(a.x.objective - verdict.objective), 1e-9 * size);
}

double largest(const Solution& x) {
  return std::max({largest(x.equality_multipliers), largest(x.inequality_multipliers),
                   largest(x.complementarity_multipliers_L), largest(x.complementarity_multipliers_R)});
}

// An error of a multiplier, up to that of the point's stationarity, is multiplied by the row in their
// product.
void expect_slack(const std::vector<double>& rows, const std::vector<double>& multipliers, double size,
                  double loose) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    FUZZ_JUDGE_AT_MOST(std::abs(rows[i] * multipliers[i]) / (1.0 + size),
                       loose * std::max(1.0, std::abs(rows[i])));
  }
}

void expect_stationary(const Answer& a, const Options& options, const testing::Verdict& verdict) {
  const double size = largest(a.x);
  const double loose = 10.0 *
                       std::max({options.stationarity_tolerance, options.complementarity_tolerance,
                                 options.inequality_tolerance}) *
                       (a.x.status == Status::solved ? 1.0 : 100.0);
  FUZZ_JUDGE_AT_MOST(verdict.stationarity, std::max(kRelative, 10.0 * loose));
  FUZZ_JUDGE_AT_MOST(verdict.wrong_sign, std::max(kRelative, loose) * size);
  if (!options.polish || options.path == Path::algorithm1) return;
  const double slack = std::max(kRelative, 10.0 * loose);
  expect_slack(a.inequalities.value, a.x.inequality_multipliers, size, slack);
  expect_slack(a.left.value, a.x.complementarity_multipliers_L, size, slack);
  expect_slack(a.right.value, a.x.complementarity_multipliers_R, size, slack);
  for (std::size_t i = 0; i < a.left.value.size(); ++i) {
    const double xi = a.x.complementarity_multipliers_L[i], eta = a.x.complementarity_multipliers_R[i];
    if (a.left.value[i] > 1e-7 || a.right.value[i] > 1e-7) continue;
    const double least = -std::max(kRelative, loose) * size;
    if (a.x.stationarity == Stationarity::strong) FUZZ_JUDGE(xi >= least && eta >= least);
    if (a.x.stationarity == Stationarity::clarke) FUZZ_JUDGE(xi * eta >= least * size);
  }
}

// 1 / (a number of its rows): A'y − C'nu − L'xi − R'eta = 0 with b'y − d'nu − l'xi − r'eta = 1.
void expect_refuted(const ProblemView& p, std::span<const double> proof) {
  const auto n = static_cast<Eigen::Index>(p.g.size());
  std::size_t at = 0;
  Vector sum = Vector::Zero(n), size = Vector::Ones(n);
  double constant = 0.0, constant_size = 1.0;
  const auto take = [&](const SparseMatrixView& m, std::span<const double> offset, double sign) {
    FUZZ_JUDGE(at + offset.size() <= proof.size());
    const Vector y = dense(proof.subspan(at, offset.size()));
    if (sign < 0.0 && y.size() > 0) FUZZ_JUDGE(y.minCoeff() >= 0.0);
    at += offset.size();
    const Matrix rows = dense(m, y.size(), n, m.values);
    sum += sign * rows.transpose() * y;
    size += rows.cwiseAbs().transpose() * y.cwiseAbs();
    constant += sign * dense(offset).dot(y);
    constant_size += dense(offset).cwiseAbs().dot(y.cwiseAbs());
  };
  take(p.A, p.b, 1.0), take(p.C, p.d, -1.0), take(p.L, p.l, -1.0), take(p.R, p.r, -1.0);
  FUZZ_JUDGE(at == proof.size());
  FUZZ_JUDGE((sum.cwiseAbs().array() <= 1e-6 * size.array()).all());
  FUZZ_JUDGE_AT_MOST(std::abs(constant - 1.0), 1e-6 * constant_size);
}

void expect_unbounded(const ProblemView& p, std::span<const double> direction) {
  const auto n = static_cast<Eigen::Index>(p.g.size());
  FUZZ_JUDGE(direction.size() == p.g.size());
  const Vector v = dense(direction) / std::max(1e-300, dense(direction).lpNorm<Eigen::Infinity>());
  const auto rows = [&](const SparseMatrixView& m, std::size_t count) {
    return Vector(dense(m, static_cast<Eigen::Index>(count), n, m.values) * v);
  };
  const double zero = 1e-5;
  for (const double row : rows(p.A, p.b.size())) FUZZ_JUDGE_AT_MOST(std::abs(row), zero);
  for (const double row : rows(p.C, p.d.size())) FUZZ_JUDGE(row >= -zero);
  const Vector s = rows(p.L, p.l.size()), t = rows(p.R, p.r.size());
  for (Eigen::Index i = 0; i < s.size(); ++i) FUZZ_JUDGE_AT_MOST(std::abs(std::min(s[i], t[i])), zero);
  const Vector Qv = dense_hessian(p, p.Q.values) * v;
  FUZZ_JUDGE(v.dot(Qv) < 0.0 || (Qv.lpNorm<Eigen::Infinity>() <= zero && dense(p.g).dot(v) < 0.0));
}

// By enumeration, where there is little to enumerate.
void expect_optimal(const ProblemView& p, const Options& options, const Solution& x) {
  if (p.l.size() > 3 || p.g.size() > 7) return;
  std::optional<testing::GlobalOptimum> best;
  try {
    best = testing::brute_force(p);
  } catch (const std::invalid_argument&) {
    return;  // not convex on a branch
  }
  if (x.status == Status::infeasible) FUZZ_JUDGE(!best);
  if (!best || !std::isfinite(best->objective)) return;
  FUZZ_JUDGE(x.status != Status::unbounded);
  const double rough = 1e-4 * (1.0 + std::abs(best->objective)) * largest(x);
  FUZZ_JUDGE(!(x.bound > best->objective + rough));
  const double tolerance = std::max({options.equality_tolerance, options.inequality_tolerance,
                                     options.complementarity_tolerance, options.stationarity_tolerance});
  if (!is_solved(x.status) || tolerance > 1e-5) return;
  if (best->certain) FUZZ_JUDGE(x.objective >= best->objective - rough);
  const double gap = options.relative_gap_tolerance * std::max(1.0, std::abs(x.objective));
  if (x.proved && x.status == Status::solved) FUZZ_JUDGE_AT_MOST(x.objective, best->objective + gap + rough);
}

// Its parts are the problem's; what is small has no point, by enumeration.
void expect_conflict(const ProblemView& p, const Conflict& conflict, bool friendly) {
  FUZZ_JUDGE(conflict.size() > 0 && !conflict.detail.empty());
  const auto within = [](const std::vector<Index>& rows, std::size_t count) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      FUZZ_JUDGE(rows[k] >= 0 && static_cast<std::size_t>(rows[k]) < count);
      FUZZ_JUDGE(k == 0 || rows[k - 1] < rows[k]);
    }
  };
  within(conflict.equalities, p.b.size());
  within(conflict.inequalities, p.d.size());
  for (const auto* pairs : {&conflict.left_sides, &conflict.right_sides, &conflict.complementarities})
    within(*pairs, p.l.size());
  if (!friendly || p.l.size() > 3 || p.g.size() > 7) return;
  FUZZ_JUDGE(!testing::have_point(p, conflict));
}

}  // namespace

void expect_sound(const Error& error) {
  FUZZ_JUDGE(!error.message().empty());
  FUZZ_JUDGE(error.code != ErrorCode::internal);
}

void expect_sound(const v1::Solution& answer) {
  const std::string bytes = answer.SerializeAsString();
  v1::Solution again;
  FUZZ_JUDGE(again.ParseFromString(bytes));
  FUZZ_JUDGE(again.SerializeAsString() == bytes);
  FUZZ_JUDGE(answer.status() != v1::STATUS_UNSPECIFIED && v1::Status_IsValid(answer.status()));
  expect_finite(answer, is_solved(status_of(answer.status())));
}

bool is_friendly(const ProblemView& p) {
  for (const auto values : {p.Q.values, p.A.values, p.C.values, p.L.values, p.R.values, p.g, p.b, p.d, p.l,
                            p.r, std::span(&p.c0, 1)}) {
    if (!is_friendly(values)) return false;
  }
  return true;
}

void judge_answer(const ProblemView& p, const Options& options, const v1::Solution& reported,
                  double agreement) {
  const Solution x = solution_of(reported);
  if (std::getenv("MARBLE_FUZZ_PRINT") != nullptr) std::fputs(reported.DebugString().c_str(), stderr);
  ++tally().answers;
  if (is_solved(x.status)) ++tally().solved;
  FUZZ_JUDGE(x.z.size() == p.g.size());
  FUZZ_JUDGE(x.equality_multipliers.size() == p.b.size());
  FUZZ_JUDGE(x.inequality_multipliers.size() == p.d.size());
  FUZZ_JUDGE(x.complementarity_multipliers_L.size() == p.l.size());
  FUZZ_JUDGE(x.complementarity_multipliers_R.size() == p.r.size());
  FUZZ_JUDGE(!x.detail.empty());
  const Answer answer(p, x);
  const testing::Verdict verdict = testing::judge(p, x);
  expect_reported(p, answer, verdict);
  if (is_solved(x.status)) expect_feasible(answer, options, agreement);
  if (x.status == Status::solved && std::isfinite(verdict.stationarity))
    FUZZ_JUDGE_AT_MOST(verdict.stationarity, std::max(kFirstDigit, agreement) * (1.0 + kRounding));
  const bool friendly = is_friendly(p);
  if (x.conflict) {
    FUZZ_JUDGE(options.explain && x.status == Status::infeasible);
    expect_conflict(p, *x.conflict, friendly);
  }
  if (!friendly) return;
  if (is_solved(x.status)) expect_stationary(answer, options, verdict);
  if (x.status == Status::infeasible && !x.certificate.empty()) expect_refuted(p, x.certificate);
  if (x.status == Status::unbounded) expect_unbounded(p, x.certificate);
  expect_optimal(p, options, x);
}

void judge_request(const v1::SolveRequest& request, const Options& options, const v1::Solution& answer) {
  expect_sound(answer);
  FUZZ_JUDGE(answer.has_coupled() == request.has_coupled());
  FUZZ_JUDGE(answer.has_scenarios() == request.has_scenarios());
  if (request.has_scenarios()) {
    if (answer.scenarios().scenarios() == 0) return;
    ScenarioProblem scenarios;
    scenarios.base = view_of(request.problem());
    FUZZ_JUDGE(take_scenarios(request.scenarios(), scenarios).has_value());
    const auto stage = assemble_scenarios(scenarios, answer.scenarios().scenarios());
    FUZZ_JUDGE(stage.has_value());
    v1::Solution of_stage = answer;  // its status may be that of a later stage
    for (const v1::SampleAverageStage& reported : answer.scenarios().stages()) {
      if (reported.scenarios() == answer.scenarios().scenarios()) of_stage.set_status(reported.status());
    }
    judge_answer(stage->view(), options, of_stage);
  } else if (request.coupled().blocks_size() > 0) {
    const OwnedProblem monolithic = monolithic_problem(coupled_of(request.coupled()));
    Options loose = options;
    double agreement = 0.0;
    if (request.coupled().has_monolithic() && !request.coupled().monolithic()) {  // rows hold as blocks agree
      agreement = 1e3 * (request.coupled().has_tolerance() ? request.coupled().tolerance() : 1e-9);
      loose.polish = false;
      for (double* tolerance : {&loose.equality_tolerance, &loose.stationarity_tolerance})
        *tolerance = std::max({*tolerance, 1e-3, agreement});
    }
    judge_answer(monolithic.view(), loose, answer, agreement);
  } else {
    judge_answer(view_of(request.problem()), options, answer);
    if (request.has_sensitivity())
      judge_derivatives(view_of(request.problem()), request.sensitivity(), answer);
  }
}

}  // namespace marble::fuzz
