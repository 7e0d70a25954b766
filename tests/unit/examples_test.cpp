#include "marble/examples.h"

#include <gtest/gtest.h>

#include "marble/problem.h"

namespace marble::examples {
namespace {

void expect_sizes(const OwnedProblem& p, Index n, Index n_e, Index n_i, Index n_c) {
  const auto problem = Problem::create(p.view());
  ASSERT_TRUE(problem.has_value()) << problem.error().message();
  EXPECT_EQ(problem->variables(), n);
  EXPECT_EQ(problem->equalities(), n_e);
  EXPECT_EQ(problem->inequalities(), n_i);
  EXPECT_EQ(problem->pairs(), n_c);
}

TEST(Examples, HaveTheSizesOfThePapersTableOne) {
  expect_sizes(hopper(), 1560, 780, 540, 540);
  expect_sizes(gates(), 1706, 760, 1942, 120);
  expect_sizes(rocket(), 678, 444, 718, 40);
}

TEST(Examples, GrowWithTheHorizon) {
  expect_sizes(hopper({.steps = 10}), 260, 130, 90, 90);
  EXPECT_TRUE(Problem::create(rocket({.steps = 2}).view()).has_value());
  EXPECT_TRUE(Problem::create(gates({.steps = 2}).view()).has_value());
}

TEST(Examples, ASeedMeansTheSameProblemAndZeroTheNominalOne) {
  EXPECT_EQ(hopper(vary(HopperParameters{}, 0)).g, hopper().g);
  EXPECT_EQ(rocket(vary(RocketParameters{}, 7)).b, rocket(vary(RocketParameters{}, 7)).b);
  EXPECT_NE(rocket(vary(RocketParameters{}, 7)).b, rocket(vary(RocketParameters{}, 8)).b);
  EXPECT_NE(gates(vary(GatesParameters{}, 1)).b, gates().b);
}

TEST(Examples, StandingStillOnFlatGroundIsFeasibleForTheHopper) {
  // Body above the foot, foot on the ground at x = 0, leg force and normal force holding the weight.
  HopperParameters parameters{.steps = 3};
  parameters.reference_x = 0.0;
  const OwnedProblem p = hopper(parameters);
  std::vector<double> z(p.g.size(), 0.0);
  for (int k = 0; k < 3; ++k) {
    double* step = z.data() + kHopperVariables * k;
    step[kBodyZ] = parameters.position[1];
    step[kForceZ] = parameters.body_mass * parameters.gravity;
    step[kNormalForce] = (parameters.body_mass + parameters.foot_mass) * parameters.gravity;
    for (int i = 0; i < 4; ++i) {  // left of every edge: sign −1, λ⁻ its distance
      step[kSign + i] = -1.0;
      step[kSignMinus + i] = parameters.stair_x[static_cast<std::size_t>(i)];
    }
  }
  const auto rows = [&z](const SparseMatrix& m, std::vector<double> out) {
    for (Index j = 0; j < m.columns; ++j) {
      for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
        out[m.row_indices[k]] += m.values[k] * z[j];
    }
    return out;
  };
  for (const double row : rows(p.A, p.b)) EXPECT_NEAR(row, 0.0, 1e-12);
  for (const double row : rows(p.C, p.d)) EXPECT_GE(row, -1e-12);
  const auto s = rows(p.L, p.l);
  const auto t = rows(p.R, p.r);
  for (std::size_t i = 0; i < s.size(); ++i) EXPECT_NEAR(std::min(s[i], t[i]), 0.0, 1e-12) << i;
}

}  // namespace
}  // namespace marble::examples
