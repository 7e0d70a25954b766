// What a solver is set up with: memory it may take, options that may change.
#include <gtest/gtest.h>

#include "marble/examples.h"
#include "marble/solver.h"

namespace marble {
namespace {

TEST(Setup, RefusesAProblemThatNeedsMoreMemoryThanItMayHave) {
  for (const OwnedProblem& p : {examples::hopper(), examples::qpec({}, 1), examples::rocket()}) {
    const Problem problem = Problem::create(p.view()).value();
    const std::int64_t bytes = Solver::create(problem).value().memory_bytes();
    EXPECT_TRUE(Solver::create(problem, {}, {.most_bytes = bytes}).has_value());
    const auto refused = Solver::create(problem, {}, {.most_bytes = bytes / 2});
    ASSERT_FALSE(refused.has_value());
    EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
    EXPECT_EQ(refused.error().field, "problem");
    EXPECT_NE(refused.error().bound.find(std::to_string(bytes / 2)), std::string::npos);
  }
}

TEST(Setup, TakesOtherOptionsForSolvesToCome) {
  const OwnedProblem p = examples::rocket();
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  Options options;
  options.max_iterations = 0;
  ASSERT_TRUE(solver.set_options(options).has_value());
  EXPECT_EQ(solver.solve()->status, Status::iteration_limit);
  ASSERT_TRUE(solver.set_options({}).has_value());
  EXPECT_EQ(solver.solve()->status, Status::solved);
  options.max_iterations = -1;
  EXPECT_EQ(solver.set_options(options).error().field, "max_iterations");
}

}  // namespace
}  // namespace marble
