// Derivatives that are asked for with a solve: the same numbers as of marble::Sensitivity, by the factor that
// the solve ends with, and the response of rows against the branch's own matrix written out.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "dense_system.h"
#include "marble/examples.h"
#include "marble/sensitivity.h"
#include "marble/warm_solver.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using Values = std::vector<double>;
using Matrix = Eigen::MatrixXd;

constexpr int kSeeds = 16;

Values drawn(std::size_t size, std::mt19937_64& engine) {
  Values values(size);
  for (double& value : values) value = static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0;
  return values;
}

Matrix dense_of(const SparseMatrix& m, Index rows, Index columns) {
  Matrix result = Matrix::Zero(rows, columns);
  if (m.values.empty()) return result;
  for (Index j = 0; j < columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      result(m.row_indices[k], j) = m.values[k];
  }
  return result;
}

/// m rows of three entries each.
SparseMatrix some_rows(Index m, Index n, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  Triplets entries;
  for (Index i = 0; i < m; ++i) {
    for (int k = 0; k < 3; ++k)
      entries.add(i, static_cast<Index>(engine() % static_cast<std::uint64_t>(n)),
                  1.0 + static_cast<double>(engine() % 8));
  }
  return compress(m, n, entries, "E").value();
}

/// P of a branch: the upper left block of its matrix's inverse, by a basis of the null space of its rows.
struct Branch {
  Branch(const OwnedProblem& p, const Solution& answer, const Vector& less) {
    const auto n = static_cast<Index>(p.g.size());
    Q = dense_of(p.Q, n, n);
    Q.diagonal() -= less;
    const Matrix A = dense_of(p.A, static_cast<Index>(p.b.size()), n);
    const Matrix C = dense_of(p.C, static_cast<Index>(p.d.size()), n);
    const Matrix L = dense_of(p.L, static_cast<Index>(p.l.size()), n);
    const Matrix R = dense_of(p.R, static_cast<Index>(p.r.size()), n);
    z = Eigen::Map<const Vector>(answer.z.data(), n);
    Matrix rows = A;
    const auto take = [&](const Matrix& from, const Values& offset) {
      for (Index i = 0; i < from.rows(); ++i) {
        if (from.row(i).dot(z) + offset[static_cast<std::size_t>(i)] > 1e-7) continue;
        rows.conservativeResize(rows.rows() + 1, n);
        rows.row(rows.rows() - 1) = from.row(i);
      }
    };
    take(C, p.d), take(L, p.l), take(R, p.r);
    Matrix basis = Matrix::Identity(n, n);
    if (rows.rows() > 0) basis = Eigen::FullPivLU<Matrix>(rows).kernel();
    P = basis.isZero() ? Matrix::Zero(n, n)
                       : Matrix(basis * (basis.transpose() * Q * basis).inverse() * basis.transpose());
  }
  Matrix Q, P;
  Vector z;
};

Solution asked(const OwnedProblem& p, const SensitivityRequest& request) {
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  return solver.solve({.sensitivity = &request}).value();
}

const SensitivityAnswer& reported(const Solution& answer) {
  EXPECT_TRUE(answer.sensitivity.has_value() && answer.sensitivity->has_value())
      << (answer.sensitivity ? answer.sensitivity->error().message() : "nothing was reported");
  return answer.sensitivity->value();
}

void expect_alike(std::span<const double> a, std::span<const double> b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_NEAR(a[i], b[i], 1e-8 * (1.0 + std::abs(b[i]))) << what << '[' << i << ']';
}

TEST(SensitivityRequest, WithASolveReportsWhatTheAnswersOwnSensitivityDoes) {
  int looked_at = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const OwnedProblem p = testing::random_problem({}, static_cast<std::uint64_t>(seed));
    std::mt19937_64 engine(seed);
    const Values b = drawn(2 * p.b.size(), engine), Q = drawn(2 * p.Q.values.size(), engine),
                 R = drawn(2 * p.R.values.size(), engine), z = drawn(2 * p.g.size(), engine);
    const SensitivityRequest request{.directions = {2, {.b = b, .Q = Q, .R = R}}, .losses = {2, {.z = z}}};
    const Solution answer = asked(p, request);
    ASSERT_TRUE(is_solved(answer.status)) << answer.detail;
    const SensitivityAnswer& sensitivity = reported(answer);
    auto own = Sensitivity::create(Problem::create(p.view()).value(), answer).value();
    EXPECT_EQ(sensitivity.weak_inequalities, own.weak_inequalities());
    EXPECT_EQ(sensitivity.biactive_pairs, own.biactive_pairs());
    if (!own.is_smooth()) continue;
    ++looked_at;
    EXPECT_TRUE(sensitivity.changes.undefined.empty() && sensitivity.gradients.undefined.empty());
    for (std::size_t k = 0; k < 2; ++k) {
      const auto part = [k](const Values& values) {
        return std::span(values).subspan(k * values.size() / 2, values.size() / 2);
      };
      const AnswerChange change = own.along({.b = part(b), .Q = part(Q), .R = part(R)}).value();
      expect_alike(part(sensitivity.changes.z), change.z, "z");
      expect_alike(part(sensitivity.changes.equality_multipliers), change.equality_multipliers, "y");
      expect_alike(part(sensitivity.changes.complementarity_multipliers_L),
                   change.complementarity_multipliers_L, "xi");
      EXPECT_EQ(sensitivity.changes.active_set_constant[k] != 0, change.active_set_constant);
      const ProblemGradient gradient = own.gradient({.z = part(z)}).value();
      expect_alike(part(sensitivity.gradients.g), gradient.g, "g");
      expect_alike(part(sensitivity.gradients.l), gradient.l, "l");
      expect_alike(part(sensitivity.gradients.Q), gradient.Q, "Q");
      expect_alike(part(sensitivity.gradients.A), gradient.A, "A");
    }
  }
  EXPECT_GE(looked_at, kSeeds / 2);
}

// Eight at a time have the factor's indices read once for all of them. Offsets of pairs only where the
// branch's rows are independent.
void expect_many_as_one_by_one(const OwnedProblem& p, Index count, bool offsets, double most) {
  std::mt19937_64 engine(count);
  const auto n = static_cast<Index>(p.g.size());
  const auto times = static_cast<std::size_t>(count);
  const Values g = drawn(times * p.g.size(), engine), b = drawn(times * p.b.size(), engine),
               l = drawn(offsets ? times * p.l.size() : 0, engine),
               A = drawn(times * p.A.values.size(), engine), Q = drawn(times * p.Q.values.size(), engine),
               z = drawn(times * p.g.size(), engine), xi = drawn(l.size(), engine);
  const SparseMatrix rows = some_rows(count, n, 1);
  const SensitivityRequest request{.rows = RowsRequest{.E = rows.view(), .columns = true},
                                   .directions = {count, {.g = g, .b = b, .l = l, .Q = Q, .A = A}},
                                   .losses = {count, {.z = z, .complementarity_multipliers_L = xi}}};
  const Solution answer = asked(p, request);
  ASSERT_TRUE(is_solved(answer.status)) << answer.detail;
  const SensitivityAnswer& many = reported(answer);
  EXPECT_TRUE(many.changes.undefined.empty() && many.gradients.undefined.empty());
  const SensitivityAnswer later =
      Sensitivity::create(Problem::create(p.view()).value(), answer).value().answer(request).value();
  expect_alike(later.changes.z, many.changes.z, "z, asked for later");
  expect_alike(later.gradients.A, many.gradients.A, "A, asked for later");
  for (std::size_t k = 0; k < times; ++k) {
    SCOPED_TRACE(k);
    const auto part = [k, times](const Values& values) {
      return std::span(values).subspan(k * (values.size() / times), values.size() / times);
    };
    const auto expect_same = [&](const Values& all, std::span<const double> one, const char* what) {
      ASSERT_EQ(part(all).size(), one.size()) << what;
      double size = 1.0;
      for (const double value : one) size = std::max(size, std::abs(value));
      for (std::size_t i = 0; i < one.size(); ++i)
        ASSERT_NEAR(part(all)[i], one[i], most * size) << what << '[' << i << ']';
    };
    const SparseMatrix row = [&] {
      Triplets entries;
      for (Index j = 0; j < n; ++j) {
        for (Index i = rows.column_pointers[j]; i < rows.column_pointers[j + 1]; ++i) {
          if (rows.row_indices[i] == static_cast<Index>(k)) entries.add(0, j, rows.values[i]);
        }
      }
      return compress(1, n, entries, "E").value();
    }();
    const SensitivityRequest alone{
        .rows = RowsRequest{.E = row.view(), .columns = true},
        .directions = {1, {.g = part(g), .b = part(b), .l = part(l), .Q = part(Q), .A = part(A)}},
        .losses = {1, {.z = part(z), .complementarity_multipliers_L = part(xi)}}};
    const Solution again = asked(p, alone);
    const SensitivityAnswer& one = reported(again);
    expect_same(many.changes.z, one.changes.z, "z");
    expect_same(many.changes.equality_multipliers, one.changes.equality_multipliers, "y");
    expect_same(many.changes.complementarity_multipliers_R, one.changes.complementarity_multipliers_R, "eta");
    EXPECT_EQ(many.changes.active_set_constant[k], one.changes.active_set_constant[0]);
    expect_same(many.gradients.g, one.gradients.g, "g");
    expect_same(many.gradients.r, one.gradients.r, "r");
    expect_same(many.gradients.A, one.gradients.A, "A");
    expect_same(many.gradients.Q, one.gradients.Q, "Q");
    expect_same(many.rows->value().columns, one.rows->value().columns, "P Eᵀ");
    EXPECT_NEAR(many.rows->value().response[k + k * (k + 1) / 2], one.rows->value().response[0],
                most * (1.0 + std::abs(one.rows->value().response[0])));
    const auto dot = [](std::span<const double> a, std::span<const double> c) {
      return std::inner_product(a.begin(), a.end(), c.begin(), 0.0);
    };
    const double forward = dot(part(z), part(many.changes.z)) +
                           (offsets ? dot(part(xi), part(many.changes.complementarity_multipliers_L)) : 0.0);
    const Values& by_l = many.gradients.l;
    const double adjoint = dot(part(many.gradients.g), part(g)) + dot(part(many.gradients.b), part(b)) +
                           (offsets ? dot(part(by_l), part(l)) : 0.0) + dot(part(many.gradients.Q), part(Q)) +
                           dot(part(many.gradients.A), part(A));
    EXPECT_NEAR(adjoint, forward, 1e-8 * (1.0 + std::abs(forward)));
  }
}

TEST(SensitivityRequest, ManyAtOnceAreToTheBitWhatEachIsByItselfWithASparseFactor) {
  for (const Index count : {3, 9, 15})
    expect_many_as_one_by_one(examples::hopper({.steps = 8}), count, false, 0.0);
}

// BLAS sums in another order for more of them; both ways leave a residual of 1e-12 at most.
TEST(SensitivityRequest, ManyAtOnceAreWhatEachIsByItselfWithADenseFactorOrOneInBlocks) {
  for (const Index count : {2, 5, 9}) {
    expect_many_as_one_by_one(testing::random_problem({}, 1), count, true, 1e-10);
    expect_many_as_one_by_one(testing::random_problem({.variables = 120, .pairs = 20}, 2), count, true,
                              1e-10);
  }
}

TEST(SensitivityRequest, RowsRespondAsTheBranchsOwnMatrixHasIt) {
  constexpr Index kRows = 4;
  int looked_at = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const OwnedProblem p = testing::random_problem({}, 300U + static_cast<std::uint64_t>(seed));
    const auto n = static_cast<Index>(p.g.size());
    const SparseMatrix rows = some_rows(kRows, n, static_cast<std::uint64_t>(seed));
    const SensitivityRequest request{.rows = RowsRequest{.E = rows.view(), .columns = true}};
    const Solution answer = asked(p, request);
    ASSERT_TRUE(is_solved(answer.status)) << answer.detail;
    if (!reported(answer).is_smooth()) continue;
    ++looked_at;
    const RowResponse& response = reported(answer).rows->value();
    const Branch branch(p, answer, Vector::Zero(n));
    const Matrix E = dense_of(rows, kRows, n), S = E * branch.P * E.transpose();
    const Vector values = E * branch.z;
    expect_alike(response.values, {values.data(), kRows}, "values");
    expect_alike(response.free, {values.data(), kRows}, "free");
    expect_alike(response.z, answer.z, "z(0)");
    const Matrix columns = branch.P * E.transpose();
    expect_alike(response.columns, {columns.data(), static_cast<std::size_t>(columns.size())}, "columns");
    ASSERT_EQ(response.response.size(), kRows * (kRows + 1) / 2U);
    for (Index j = 0; j < kRows; ++j) {
      for (Index i = 0; i <= j; ++i)
        EXPECT_NEAR(response.response[static_cast<std::size_t>(i + j * (j + 1) / 2)], S(i, j),
                    1e-8 * (1.0 + std::abs(S(i, j))));
    }
  }
  EXPECT_GE(looked_at, kSeeds / 2);
}

TEST(SensitivityRequest, AProximalTermIsLeftOutOfTheResponseAndOfNothingElse) {
  constexpr Index kRows = 3;
  int looked_at = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    OwnedProblem p = testing::random_problem({}, 500U + static_cast<std::uint64_t>(seed));
    const auto n = static_cast<Index>(p.g.size());
    std::mt19937_64 engine(seed);
    Values proximal(p.g.size()), g = p.g, z = drawn(p.g.size(), engine), d = drawn(p.d.size(), engine);
    for (std::size_t j = 0; j < proximal.size(); ++j) proximal[j] = 0.25 + 0.5 * static_cast<double>(j % 2);
    // Q + Σ with the cost g − Σ z⁻, as a coupled solve has it.
    for (Index j = 0; j < n; ++j) {
      for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
        if (p.Q.row_indices[k] == j) p.Q.values[k] += proximal[j];
      }
      p.g[j] -= proximal[j] * z[j];
    }
    const SparseMatrix rows = some_rows(kRows, n, static_cast<std::uint64_t>(seed));
    const SensitivityRequest request{
        .rows = RowsRequest{.E = rows.view(), .proximal = proximal, .g = g, .columns = true},
        .directions = {1, {.d = d}}};
    const Solution answer = asked(p, request);
    ASSERT_TRUE(is_solved(answer.status)) << answer.detail;
    if (!reported(answer).is_smooth()) continue;
    ++looked_at;
    const RowResponse& response = reported(answer).rows->value();
    const Branch branch(p, answer, Eigen::Map<const Vector>(proximal.data(), n));
    const Matrix E = dense_of(rows, kRows, n), S = E * branch.P * E.transpose();
    const Vector at_zero =
        branch.z - branch.P * (branch.Q * branch.z + Eigen::Map<const Vector>(g.data(), n));
    expect_alike(response.z, {at_zero.data(), g.size()}, "z(0)");
    const Vector free = E * at_zero;
    expect_alike(response.free, {free.data(), kRows}, "free");
    EXPECT_NEAR(response.response[1], S(0, 1), 1e-8 * (1.0 + std::abs(S(0, 1))));
    EXPECT_GE(reported(answer).factorizations, 1);
    auto own = Sensitivity::create(Problem::create(p.view()).value(), answer).value();
    ASSERT_TRUE(own.rows(*request.rows).has_value());
    expect_alike(reported(answer).changes.z, own.along({.d = d}).value().z,
                 "a change, asked for after the rows");
  }
  EXPECT_GE(looked_at, kSeeds / 2);
}

TEST(SensitivityRequest, ATicksAnswersAreTheSameWhetherItIsAskedOrNotAndItsFactorIsUsedAgain) {
  const OwnedProblem p = testing::random_problem({.variables = 40, .pairs = 10}, 3);
  const auto n = static_cast<Index>(p.g.size());
  const SparseMatrix rows = some_rows(5, n, 1);
  const SensitivityRequest request{.rows = RowsRequest{.E = rows.view()}};
  const Problem problem = Problem::create(p.view()).value();
  WarmSolver asks = WarmSolver::create(problem).value(), does_not = WarmSolver::create(problem).value();
  int factorizations = 0;
  for (int tick = 0; tick < 8; ++tick) {
    SCOPED_TRACE(tick);
    Values g = p.g;
    g[0] += 1e-3 * tick;
    const Solution with = asks.solve({.g = g}, {}, {.sensitivity = &request}).value();
    const Solution without = does_not.solve({.g = g}).value();
    EXPECT_EQ(with.z, without.z);
    EXPECT_EQ(with.complementarity_multipliers_L, without.complementarity_multipliers_L);
    const SensitivityAnswer& sensitivity = reported(with);
    EXPECT_EQ(with.factorizations, without.factorizations + sensitivity.factorizations);
    EXPECT_LE(sensitivity.back_substitutions, 3 * 5);
    if (tick > 0) factorizations += sensitivity.factorizations;
    EXPECT_FALSE(without.sensitivity.has_value());
  }
  EXPECT_EQ(factorizations, 0) << "of a warm tick the last factor is the branch's";
}

TEST(SensitivityRequest, ProximalRowsLeaveTheNextTicksAsTheyWere) {
  const OwnedProblem p = testing::random_problem({}, 7);
  const auto n = static_cast<Index>(p.g.size());
  const SparseMatrix rows = some_rows(2, n, 1);
  const Values proximal(p.g.size(), 1e-3);
  const SensitivityRequest request{.rows = RowsRequest{.E = rows.view(), .proximal = proximal}};
  const Problem problem = Problem::create(p.view()).value();
  WarmSolver asks = WarmSolver::create(problem).value(), does_not = WarmSolver::create(problem).value();
  for (int tick = 0; tick < 4; ++tick) {
    Values b = p.b;
    b[0] += 1e-3 * tick;
    const Solution with = asks.solve({.b = b}, {}, {.sensitivity = &request}).value();
    EXPECT_TRUE(reported(with).rows->has_value());
    EXPECT_EQ(with.z, does_not.solve({.b = b}).value().z);
  }
}

TEST(SensitivityRequest, AnAnswerThatIsNotSolvedSaysSoInsteadOfDerivatives) {
  const OwnedProblem p = testing::random_problem({}, 2);
  const SensitivityRequest request{.losses = {1, {}}};
  Options options;
  options.max_iterations = 0;
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  const Solution answer = solver.solve({.sensitivity = &request}).value();
  ASSERT_TRUE(answer.sensitivity.has_value());
  EXPECT_EQ(answer.sensitivity->error().message(), "solution: must be solved: it is iteration_limit");
}

TEST(SensitivityRequest, WhatDoesNotFitIsAnErrorOfTheSolve) {
  const OwnedProblem p = testing::random_problem({}, 2);
  const Problem problem = Problem::create(p.view()).value();
  const auto refused = [&](const SensitivityRequest& request) {
    return Solver::create(problem).value().solve({.sensitivity = &request}).error().message();
  };
  const auto n = static_cast<Index>(p.g.size());
  SparseMatrix rows = some_rows(2, n, 1);
  EXPECT_EQ(refused({.rows = RowsRequest{}}), "sensitivity.rows.E.rows = 0: must be >= 1");
  const Values minus(p.g.size(), -1.0), short_one(2, 1.0);
  EXPECT_EQ(refused({.rows = RowsRequest{.E = rows.view(), .proximal = minus}}),
            "sensitivity.rows.proximal[0] = -1.000000: must be >= 0");
  SparseMatrix tall = rows;
  tall.rows = n + static_cast<Index>(tall.values.size()) + 1;
  EXPECT_EQ(refused({.rows = RowsRequest{.E = tall.view()}}),
            "sensitivity.rows.E.rows = " + std::to_string(tall.rows) + ": must be at most " +
                std::to_string(tall.rows - 1) + ", the variables and entries");
  rows.values[1] = std::nan("");
  EXPECT_EQ(refused({.rows = RowsRequest{.E = rows.view()}}),
            "sensitivity.rows.E.values[1] = nan: must be finite");
  EXPECT_EQ(refused({.directions = {2, {.g = short_one}}}),
            "sensitivity.directions.g = 2 entries: must have 24 entries");
  EXPECT_EQ(refused({.losses = {-1, {}}}), "sensitivity.losses.count = -1: must be >= 0");
  EXPECT_EQ(refused({.losses = {1 << 30, {}}}),
            "sensitivity.losses.count = 1073741824: must be at most 1, as none has numbers");
  EXPECT_EQ(refused({.directions = {2, {}}}),
            "sensitivity.directions.count = 2: must be at most 1, as none has numbers");
  EXPECT_EQ(refused({.losses = {1, {.z = short_one}}}),
            "sensitivity.losses.z = 2 entries: must have 12 entries");
}

TEST(SensitivityRequest, DirectionsThatHaveNoChangeAreNamedAndTheOthersHaveTheirs) {
  OwnedProblem p;  // min z0^2, z1 free
  p.Q = {2, 2, {0, 1, 1}, {0}, {2.0}};
  p.g = {0.0, 0.0};
  const Values g = {0.0, 1.0, 1.0, 0.0};  // the second one alone is borne
  const SensitivityRequest request{.directions = {2, {.g = g}}, .losses = {2, {.z = g}}};
  const Solution answer = asked(p, request);
  const SensitivityAnswer& sensitivity = reported(answer);
  EXPECT_EQ(sensitivity.changes.undefined, (std::vector<Index>{0}));
  EXPECT_TRUE(std::isnan(sensitivity.changes.z[0]));
  EXPECT_NEAR(sensitivity.changes.z[2], -0.5, 1e-9);
  EXPECT_EQ(sensitivity.gradients.undefined, (std::vector<Index>{0}));
  EXPECT_NEAR(sensitivity.gradients.g[2], -0.5, 1e-9);
}

TEST(SensitivityRequest, ASmallContradictionBesideALargeChangeIsStillOne) {
  OwnedProblem p;  // z0 = 1, z1 = 1, 2 z1 = 2
  p.Q = {2, 2, {0, 1, 2}, {0, 1}, {1.0, 1.0}};
  p.g = {0.0, 0.0};
  p.A = {3, 2, {0, 1, 3}, {0, 1, 2}, {1.0, 1.0, 2.0}};
  p.b = {-1.0, -1.0, -2.0};
  const Values b = {1.0, 1e-7, 0.0, 1.0, 1e-7, 2e-7};  // the last two agree in the second direction only
  const Solution answer = asked(p, {.directions = {2, {.b = b}}});
  const SensitivityAnswer& sensitivity = reported(answer);
  EXPECT_EQ(sensitivity.changes.undefined, (std::vector<Index>{0}));
  EXPECT_NEAR(sensitivity.changes.z[3], -1e-7, 1e-12);
}

TEST(SensitivityRequest, AmongManyAtOnceThoseWithoutAChangeLeaveTheOthersTheirs) {
  OwnedProblem p;  // min z0^2, z1 free
  p.Q = {2, 2, {0, 1, 1}, {0}, {2.0}};
  p.g = {0.0, 0.0};
  Values g;
  for (int k = 0; k < 7; ++k) g.insert(g.end(), {1.0 + k, k % 3 == 1 ? 1.0 : 0.0});
  const SensitivityRequest request{.directions = {7, {.g = g}}, .losses = {7, {.z = g}}};
  const Solution answer = asked(p, request);
  const SensitivityAnswer& sensitivity = reported(answer);
  EXPECT_EQ(sensitivity.changes.undefined, (std::vector<Index>{1, 4}));
  EXPECT_EQ(sensitivity.gradients.undefined, (std::vector<Index>{1, 4}));
  for (std::size_t k = 0; k < 7; ++k) {
    if (k % 3 == 1) {
      EXPECT_TRUE(std::isnan(sensitivity.changes.z[2 * k]) && std::isnan(sensitivity.gradients.Q[k]));
    } else {
      EXPECT_NEAR(sensitivity.changes.z[2 * k], -0.5 * (1.0 + static_cast<double>(k)), 1e-9);
      EXPECT_NEAR(sensitivity.gradients.g[2 * k], -0.5 * (1.0 + static_cast<double>(k)), 1e-9);
    }
  }
}

TEST(SensitivityRequest, OfABiactivePairEachDirectionReportsWhetherItHolds) {
  OwnedProblem p;  // min z0^2 + z1^2, 0 <= z0 ⊥ z1 >= 0
  p.Q = {2, 2, {0, 1, 2}, {0, 1}, {2.0, 2.0}};
  p.g = {0.0, 0.0};
  p.L = {1, 2, {0, 1, 1}, {0}, {1.0}};
  p.R = {1, 2, {0, 0, 1}, {0}, {1.0}};
  p.l = p.r = {0.0};
  const Values g = {-1.0, 1.0, 1.0, -1.0};  // towards one side, and towards the other
  const SensitivityRequest request{.directions = {2, {.g = g}}};
  const Solution answer = asked(p, request);
  EXPECT_EQ(reported(answer).biactive_pairs, (std::vector<Index>{0}));
  EXPECT_FALSE(reported(answer).is_smooth());
  EXPECT_NE(reported(answer).changes.active_set_constant[0], reported(answer).changes.active_set_constant[1])
      << "each way is of one branch alone";
}

// Two pairs with both sides at zero and an inequality just active: each of the 32 ways to go out of that
// corner is of another branch.
TEST(SensitivityRequest, WhereAOneSidedChangeHoldsItIsTheDifferenceAndTheSignsSayWhere) {
  constexpr int kPairs = 2, kVariables = 2 * kPairs + 1, kDirections = 1 << kVariables;
  constexpr double kStep = 1e-3;
  OwnedProblem p;  // min |z|²
  Triplets twos, left, right, last;
  for (Index j = 0; j < kVariables; ++j) twos.add(j, j, 2.0);
  for (Index i = 0; i < kPairs; ++i) left.add(i, 2 * i, 1.0), right.add(i, 2 * i + 1, 1.0);
  last.add(0, kVariables - 1, 1.0);
  p.Q = compress(kVariables, kVariables, twos, "Q").value();
  p.L = compress(kPairs, kVariables, left, "L").value();
  p.R = compress(kPairs, kVariables, right, "R").value();
  p.C = compress(1, kVariables, last, "C").value();
  p.g.assign(kVariables, 0.0);
  p.l.assign(kPairs, 0.0), p.r.assign(kPairs, 0.0), p.d = {0.0};
  std::mt19937_64 engine(5);
  Values g = drawn(std::size_t{kDirections} * kVariables, engine);
  for (std::size_t k = 0; k < kDirections; ++k) {
    for (std::size_t j = 0; j < kVariables; ++j)
      g[k * kVariables + j] = std::copysign(g[k * kVariables + j], (k >> j) % 2 == 0 ? 1.0 : -1.0);
  }
  const SensitivityRequest request{.directions = {kDirections, {.g = g}}};
  const Solution answer = asked(p, request);
  const SensitivityAnswer& sensitivity = reported(answer);
  EXPECT_EQ(sensitivity.biactive_pairs, (std::vector<Index>{0, 1}));
  EXPECT_EQ(sensitivity.weak_inequalities, (std::vector<Index>{0}));
  int held = 0;
  for (std::size_t k = 0; k < kDirections; ++k) {
    const auto part = [&](const Values& all) { return std::span(all).subspan(k * kVariables, kVariables); };
    const auto to = part(g), change = part(sensitivity.changes.z);
    const auto stays = [&](std::size_t j) { return std::abs(change[j]) < 1e-9; };
    // −g is where the cost wants z to go. What stays at zero must want to leave the feasible set, what moves
    // must move into it.
    bool expected = true;
    for (std::size_t j = 0; j < kVariables; ++j)
      expected = expected && (stays(j) ? to[j] >= 0.0 : to[j] <= 0.0);
    EXPECT_EQ(sensitivity.changes.active_set_constant[k] != 0, expected) << "direction " << k;
    if (!expected) continue;
    ++held;
    OwnedProblem moved = p;
    for (std::size_t j = 0; j < kVariables; ++j) moved.g[j] = kStep * to[j];
    const Solution there = Solver::create(Problem::create(moved.view()).value()).value().solve().value();
    for (std::size_t j = 0; j < kVariables; ++j)
      EXPECT_NEAR(there.z[j], kStep * change[j], 1e-9) << "direction " << k << ", z[" << j << "]";
  }
  EXPECT_EQ(held, 1) << "of all ways out of the corner one is the branch's";
}

}  // namespace
}  // namespace marble
