// What the enumeration of all branches says of random problems of small integers, the solver says too.
#include "support/integer_problem.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "marble/solver.h"
#include "support/brute_force.h"
#include "support/independent_check.h"

namespace marble {
namespace {

constexpr std::uint64_t kSeeds = 60;

class IntegerProblem : public ::testing::TestWithParam<testing::IntegerFamily> {
 protected:
  template <class Judge>
  void for_each_seed(const Options& options, Judge&& judge) const {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const OwnedProblem p = testing::integer_problem(GetParam(), seed);
      const auto truth = testing::brute_force(p.view());
      const Solution found = solve_in_process(p.view(), options).value();
      ASSERT_EQ(found.status, testing::true_status(truth)) << p.name << ": " << found.detail;
      judge(p, truth, found);
    }
  }
};

TEST_P(IntegerProblem, GlobalModeHasTheStatusTheOptimumAndATrueBound) {
  Options options;
  options.global_search = true;
  for_each_seed(options, [](const OwnedProblem& p, const auto& truth, const Solution& found) {
    if (found.status != Status::solved) return;
    const double slack = 1e-6 * std::max(1.0, std::abs(truth->objective));
    EXPECT_NEAR(found.objective, truth->objective, slack) << p.name;
    EXPECT_LE(found.bound, truth->objective + slack) << p.name;
    EXPECT_TRUE(found.proved) << p.name << ": " << found.detail;
    EXPECT_LE(testing::judge(p.view(), found).infeasibility(), 1e-9) << p.name;
  });
}

TEST_P(IntegerProblem, ALocalAnswerIsBStationary) {
  for_each_seed({}, [](const OwnedProblem& p, const auto& truth, const Solution& found) {
    if (found.status != Status::solved) return;
    EXPECT_TRUE(found.b_stationary.value_or(false)) << p.name;
    const double slack = 1e-6 * std::max(1.0, std::abs(truth->objective));
    EXPECT_GE(found.objective, truth->objective - slack) << p.name;
    EXPECT_LE(testing::judge(p.view(), found).infeasibility(), 1e-9) << p.name;
  });
}

INSTANTIATE_TEST_SUITE_P(Families, IntegerProblem, ::testing::ValuesIn(testing::kIntegerFamilies),
                         [](const auto& family) { return std::string(testing::name(family.param)); });

}  // namespace
}  // namespace marble
