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

// z₀ ≥ 2 and z₀ ≤ 1.
TEST(Setup, LooksForAProofWithinTheMemoryThatIsLeft) {
  OwnedProblem p;
  p.g = {1.0};
  p.C = compress(2, 1, {{0, 1}, {0, 0}, {1.0, -1.0}}, "C").value();
  p.d = {-2.0, 1.0};
  const Problem problem = Problem::create(p.view()).value();
  const std::int64_t own = Solver::create(problem).value().memory_bytes();
  const auto status = [&problem](std::int64_t bytes) {
    return Solver::create(problem, {}, {.most_bytes = bytes}).value().solve().value().status;
  };
  EXPECT_NE(status(own), Status::infeasible) << "another system does not fit";
  EXPECT_EQ(status(own + 100'000), Status::infeasible);
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
