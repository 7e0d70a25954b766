#include "support/random_problem.h"

#include <gtest/gtest.h>

#include "support/brute_force.h"

namespace marble::testing {
namespace {

TEST(RandomProblem, HasTheSizesAskedForAndIsValid) {
  for (const Index n_e : {0, 2}) {
    for (const Index n_i : {0, 3}) {
      for (const Index n_c : {0, 4}) {
        for (const bool indefinite : {false, true}) {
          const OwnedProblem p = random_problem({.variables = 7,
                                                 .equalities = n_e,
                                                 .inequalities = n_i,
                                                 .pairs = n_c,
                                                 .indefinite = indefinite},
                                                11);
          const auto problem = Problem::create(p.view());
          ASSERT_TRUE(problem.has_value()) << problem.error().message();
          EXPECT_EQ(problem->variables(), 7);
          EXPECT_EQ(problem->equalities(), n_e);
          EXPECT_EQ(problem->inequalities(), n_i);
          EXPECT_EQ(problem->pairs(), n_c);
        }
      }
    }
  }
}

TEST(RandomProblem, ASeedMeansTheSameProblem) {
  EXPECT_EQ(random_problem({}, 5).Q.values, random_problem({}, 5).Q.values);
  EXPECT_EQ(random_problem({}, 5).l, random_problem({}, 5).l);
  EXPECT_NE(random_problem({}, 5).g, random_problem({}, 6).g);
}

TEST(RandomProblem, IsFeasible) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const OwnedProblem p = random_problem(
        {.variables = 6, .equalities = 2, .inequalities = 6, .pairs = 3, .density = 0.2}, seed);
    EXPECT_TRUE(brute_force(p.view()).has_value()) << p.name;
  }
}

}  // namespace
}  // namespace marble::testing
