// Derivatives of an answer by its problem's numbers, against answers nearby.
#include "marble/sensitivity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "marble/solver.h"
#include "support/dense_matrix.h"
#include "support/random_problem.h"

namespace marble {
namespace {

constexpr int kSeeds = 24;

/// Numbers of every part of a problem.
struct Numbers {
  std::vector<double> g, b, d, l, r, Q, A, C, L, R;
  [[nodiscard]] ProblemUpdate update() const {
    return {.g = g, .b = b, .d = d, .l = l, .r = r, .Q = Q, .A = A, .C = C, .L = L, .R = R};
  }
  [[nodiscard]] std::vector<std::vector<double>*> all() { return {&g, &b, &d, &l, &r, &Q, &A, &C, &L, &R}; }
};

Numbers numbers_of(const OwnedProblem& p) {
  return {p.g, p.b, p.d, p.l, p.r, p.Q.values, p.A.values, p.C.values, p.L.values, p.R.values};
}

void draw(std::vector<double>& values, std::mt19937_64& engine) {
  for (double& value : values) value = static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0;
}

Numbers direction_for(const OwnedProblem& p, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  Numbers direction = numbers_of(p);
  for (auto* part : direction.all()) draw(*part, engine);
  return direction;
}

Solution solved(const OwnedProblem& p) { return solve_in_process(p.view()).value(); }

/// The answer with the numbers moved by h along a direction, on the branch of `answer`.
Solution moved(const OwnedProblem& p, Numbers direction, double h, const Solution& answer) {
  Numbers numbers = numbers_of(p);
  const auto to = numbers.all(), by = direction.all();
  for (std::size_t part = 0; part < to.size(); ++part) {
    for (std::size_t k = 0; k < to[part]->size(); ++k) (*to[part])[k] += h * (*by[part])[k];
  }
  Options options;
  options.max_local_search_factorizations = 0;
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  EXPECT_TRUE(solver.update(numbers.update()).has_value());
  return solver.solve({.warm_start = &answer}).value();
}

void expect_differences(const std::vector<double>& change, const std::vector<double>& after,
                        const std::vector<double>& before, double h, const char* what) {
  for (std::size_t i = 0; i < change.size(); ++i) {
    const double difference = (after[i] - before[i]) / (2.0 * h);
    EXPECT_NEAR(change[i], difference, 1e-4 * (1.0 + std::abs(difference))) << what << '[' << i << ']';
  }
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

TEST(Sensitivity, ChangesAreTheDifferencesOfAnswersNearby) {
  int smooth = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const OwnedProblem p = testing::random_problem({}, static_cast<std::uint64_t>(seed));
    const Solution answer = solved(p);
    ASSERT_TRUE(is_solved(answer.status)) << answer.detail;
    auto sensitivity = Sensitivity::create(Problem::create(p.view()).value(), answer);
    ASSERT_TRUE(sensitivity.has_value()) << sensitivity.error().message();
    if (!sensitivity->is_smooth()) continue;
    ++smooth;
    const Numbers direction = direction_for(p, 100 + static_cast<std::uint64_t>(seed));
    const AnswerChange change = sensitivity->along(direction.update()).value();
    EXPECT_TRUE(change.active_set_constant);
    constexpr double h = 1e-6;
    const Solution after = moved(p, direction, h, answer), before = moved(p, direction, -h, answer);
    ASSERT_TRUE(is_solved(after.status) && is_solved(before.status));
    expect_differences(change.z, after.z, before.z, h, "z");
    expect_differences(change.equality_multipliers, after.equality_multipliers, before.equality_multipliers,
                       h, "y");
    expect_differences(change.inequality_multipliers, after.inequality_multipliers,
                       before.inequality_multipliers, h, "nu");
    expect_differences(change.complementarity_multipliers_L, after.complementarity_multipliers_L,
                       before.complementarity_multipliers_L, h, "xi");
    expect_differences(change.complementarity_multipliers_R, after.complementarity_multipliers_R,
                       before.complementarity_multipliers_R, h, "eta");
  }
  EXPECT_GE(smooth, kSeeds / 2);
}

TEST(Sensitivity, AGradientIsWhatAllDirectionsSay) {
  int looked_at = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const OwnedProblem p =
        testing::random_problem({.indefinite = seed % 2 == 1}, 50U + static_cast<std::uint64_t>(seed));
    const Solution answer = solved(p);
    if (!is_solved(answer.status)) continue;  // some are unbounded
    ++looked_at;
    auto sensitivity = Sensitivity::create(Problem::create(p.view()).value(), answer);
    ASSERT_TRUE(sensitivity.has_value()) << sensitivity.error().message();
    std::mt19937_64 engine(seed);
    Solution weights = answer;
    for (auto* part : {&weights.z, &weights.equality_multipliers, &weights.inequality_multipliers,
                       &weights.complementarity_multipliers_L, &weights.complementarity_multipliers_R})
      draw(*part, engine);
    const Numbers by = direction_for(p, 200 + static_cast<std::uint64_t>(seed));
    const auto change = sensitivity->along(by.update());
    const auto gradient =
        sensitivity->gradient({.z = weights.z,
                               .equality_multipliers = weights.equality_multipliers,
                               .inequality_multipliers = weights.inequality_multipliers,
                               .complementarity_multipliers_L = weights.complementarity_multipliers_L,
                               .complementarity_multipliers_R = weights.complementarity_multipliers_R});
    if (!change || !gradient) continue;  // rows that depend on each other: multipliers are not unique
    const double forward = dot(weights.z, change->z) +
                           dot(weights.equality_multipliers, change->equality_multipliers) +
                           dot(weights.inequality_multipliers, change->inequality_multipliers) +
                           dot(weights.complementarity_multipliers_L, change->complementarity_multipliers_L) +
                           dot(weights.complementarity_multipliers_R, change->complementarity_multipliers_R);
    const double adjoint = dot(gradient->g, by.g) + dot(gradient->b, by.b) + dot(gradient->d, by.d) +
                           dot(gradient->l, by.l) + dot(gradient->r, by.r) + dot(gradient->Q, by.Q) +
                           dot(gradient->A, by.A) + dot(gradient->C, by.C) + dot(gradient->L, by.L) +
                           dot(gradient->R, by.R);
    EXPECT_NEAR(adjoint, forward, 1e-8 * (1.0 + std::abs(forward)));
  }
  EXPECT_GE(looked_at, kSeeds / 2);
}

/// min z0^2 + z1^2, 0 <= z0 ⊥ z1 >= 0, with this g.
OwnedProblem corner(double g0, double g1) {
  OwnedProblem p;
  p.Q = {2, 2, {0, 1, 2}, {0, 1}, {2.0, 2.0}};
  p.g = {g0, g1};
  p.L = {1, 2, {0, 1, 1}, {0}, {1.0}};
  p.R = {1, 2, {0, 0, 1}, {0}, {1.0}};
  p.l = p.r = {0.0};
  return p;
}

TEST(Sensitivity, ACornerThatPullsBothWaysIsSmoothAndAFlatOneIsReported) {
  const OwnedProblem held = corner(1.0, 1.0), flat = corner(0.0, 0.0);
  const auto smooth = Sensitivity::create(Problem::create(held.view()).value(), solved(held));
  ASSERT_TRUE(smooth.has_value()) << smooth.error().message();
  EXPECT_TRUE(smooth->is_smooth());
  auto either = Sensitivity::create(Problem::create(flat.view()).value(), solved(flat)).value();
  EXPECT_EQ(either.biactive_pairs(), (std::vector<Index>{0}));
  const std::vector<double> right = {-1.0, 1.0}, up = {1.0, -1.0};
  EXPECT_NE(either.along({.g = right})->active_set_constant, either.along({.g = up})->active_set_constant)
      << "each way is of one branch alone";
}

TEST(Sensitivity, AWeaklyActiveInequalityHoldsOneWay) {
  OwnedProblem p;  // min ½ z^2, z >= 0
  p.Q = {1, 1, {0, 1}, {0}, {1.0}};
  p.g = {0.0};
  p.C = {1, 1, {0, 1}, {0}, {1.0}};
  p.d = {0.0};
  auto sensitivity = Sensitivity::create(Problem::create(p.view()).value(), solved(p)).value();
  EXPECT_EQ(sensitivity.weak_inequalities(), (std::vector<Index>{0}));
  const std::vector<double> in = {1.0}, out = {-1.0};
  const AnswerChange pressed = sensitivity.along({.g = in}).value(),
                     freed = sensitivity.along({.g = out}).value();
  EXPECT_NE(pressed.active_set_constant, freed.active_set_constant);
  EXPECT_NEAR((pressed.active_set_constant ? pressed : freed).z[0], pressed.active_set_constant ? 0.0 : 1.0,
              1e-9);
}

// min ½z₀² + ½z₁² + 2z₀ − z₁ with z₀ ⊥ z₁, at the corner: ξ = 2, η = −1. The branch z₀ = 0 has another
// solution.
TEST(Sensitivity, ACornerWithAMultiplierOfTheWrongSignStaysWhereItIs) {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::MatrixXd::Identity(2, 2));
  p.g = {2.0, -1.0};
  p.L = testing::sparse(Eigen::MatrixXd{{1.0, 0.0}}), p.R = testing::sparse(Eigen::MatrixXd{{0.0, 1.0}});
  p.l = p.r = {0.0};
  Solution corner;
  corner.status = Status::solved;
  corner.z = {0.0, 0.0};
  corner.complementarity_multipliers_L = {2.0}, corner.complementarity_multipliers_R = {-1.0};
  auto sensitivity = Sensitivity::create(Problem::create(p.view()).value(), corner);
  ASSERT_TRUE(sensitivity.has_value()) << sensitivity.error().message();
  EXPECT_EQ(sensitivity->biactive_pairs(), std::vector<Index>{0});
  const SparseMatrix E = testing::sparse(Eigen::MatrixXd{{1.0, 2.0}});
  const RowResponse response = sensitivity->rows({.E = E.view()}).value();
  EXPECT_NEAR(response.values[0], 0.0, 1e-12);
  EXPECT_NEAR(response.response[0], 0.0, 1e-12);
}

TEST(Sensitivity, ARowResponseThatOverflowsIsAnError) {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::MatrixXd::Identity(1, 1));
  p.g = {-1.0};
  auto sensitivity = Sensitivity::create(Problem::create(p.view()).value(), solved(p));
  ASSERT_TRUE(sensitivity.has_value()) << sensitivity.error().message();
  const SparseMatrix E = testing::sparse(Eigen::MatrixXd{{1e300}});
  const auto response = sensitivity->rows({.E = E.view()});
  ASSERT_FALSE(response.has_value());
  EXPECT_EQ(response.error().field, "rows");
}

TEST(Sensitivity, WhatDoesNotFitIsNamed) {
  const OwnedProblem p = testing::random_problem({}, 1);
  const Problem problem = Problem::create(p.view()).value();
  const Solution answer = solved(p);
  Solution other = answer;
  other.z.pop_back();
  EXPECT_EQ(Sensitivity::create(problem, other).error().field, "solution.z");
  other = answer;
  other.status = Status::iteration_limit;
  EXPECT_EQ(Sensitivity::create(problem, other).error().message(),
            "solution: must be solved: it is iteration_limit");
  auto sensitivity = Sensitivity::create(problem, answer).value();
  const std::vector<double> one = {1.0}, bad(p.g.size(), std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(sensitivity.along({.g = one}).error().field, "direction.g");
  EXPECT_EQ(sensitivity.gradient({.z = bad}).error().field, "weights.z");
  EXPECT_EQ(sensitivity.gradient({.z = bad}).error().index, 0);
}

TEST(Sensitivity, WhereTheBranchIsFlatOnlyDirectionsThatItBearsHaveAChange) {
  OwnedProblem p;  // min z0^2, z1 free
  p.Q = {2, 2, {0, 1, 1}, {0}, {2.0}};
  p.g = {0.0, 0.0};
  auto sensitivity = Sensitivity::create(Problem::create(p.view()).value(), solved(p)).value();
  const std::vector<double> bears = {1.0, 0.0}, falls = {0.0, 1.0};
  EXPECT_NEAR(sensitivity.along({.g = bears})->z[0], -0.5, 1e-9);
  EXPECT_EQ(sensitivity.along({.g = falls}).error().code, ErrorCode::failed_precondition);
}

}  // namespace
}  // namespace marble
