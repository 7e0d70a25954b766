// Option method: each of others' methods as a whole solve.
#include <gtest/gtest.h>

#include "marble/examples.h"
#include "marble/research/methods.h"
#include "research_problems.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

constexpr Method kOthers[] = {
    Method::penalty_scp, Method::relaxation, Method::l1_penalty,          Method::exterior,     Method::alag,
    Method::aladin_beta, Method::l1_barrier, Method::l1_barrier_stepwise, Method::plain_barrier};

bool is_barrier(Method method) { return method >= Method::aladin_beta || method == Method::relaxation; }

TEST(Reference, EveryMethodEndsAtTheOneMinimum) {
  for (const Method method : kOthers) {
    const Solution s = research::solve_in_process(testing::two_sides(1.0).view(), {.method = method}).value();
    EXPECT_EQ(s.status, Status::solved) << s.detail;
    EXPECT_NEAR(s.objective, 0.5, 3e-6) << s.detail;
    EXPECT_NEAR(s.complementarity_multipliers_L[0], -1.0, 1e-4) << s.detail;
    EXPECT_EQ(s.stationarity, Stationarity::strong) << s.detail;
  }
}

TEST(Reference, MostConvexProblemsAreSolvedByEachAndNoAnswerIsBetterThanItIsReportedToBe) {
  for (const Method method : kOthers) {
    int solved = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const OwnedProblem p = testing::random_problem({}, seed);
      const Solution s = research::solve_in_process(p.view(), {.method = method}).value();
      if (s.status != Status::solved) continue;
      ++solved;
      EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 2e-6) << s.detail;
      const Solution ours = solve_in_process(p.view()).value();
      EXPECT_GE(s.objective, ours.objective - 1e-4 * (1.0 + std::abs(ours.objective)))
          << p.name << ": " << s.detail;
    }
    EXPECT_GE(solved, 10) << static_cast<int>(method);  // which ones, the kernels of BLAS decide
  }
}

TEST(Reference, WhatHasNoFeasibleBranchIsNotCalledSolved) {
  for (const Method method : kOthers) {
    const Solution s =
        research::solve_in_process(testing::without_feasible_branch().view(), {.method = method}).value();
    EXPECT_FALSE(is_solved(s.status)) << s.detail;
  }
}

TEST(Reference, LimitsHoldAndTheBestPointIsTheAnswer) {
  const OwnedProblem p = examples::rocket();
  for (const Method method : kOthers) {
    const Solution s = research::solve_in_process(p.view(), {.max_iterations = 2, .method = method}).value();
    EXPECT_EQ(s.status, Status::iteration_limit) << s.detail;
    EXPECT_EQ(s.z.size(), p.g.size());
    std::stop_source stop;
    stop.request_stop();
    EXPECT_EQ(
        research::solve_in_process(p.view(), {.method = method}, {.stop = stop.get_token()}).value().status,
        Status::cancelled);
  }
}

TEST(Reference, ASolverMayChangeItsMethodFromSolveToSolve) {
  const OwnedProblem p = testing::two_sides(1.0);
  Solver solver = Solver::create(Problem::create(p.view()).value(), {},
                                 {.reference_methods = &research::reference_methods()})
                      .value();
  const Solution ours = solver.solve().value();
  for (const Method method : kOthers) {
    ASSERT_TRUE(solver.set_options({.method = method}).has_value());
    const Solution fresh = research::solve_in_process(p.view(), {.method = method}).value();
    const Solution s = solver.solve().value();
    EXPECT_EQ(s.z, fresh.z) << s.detail;
    EXPECT_EQ(solver.solve().value().z, s.z) << "and leaves no trace";
  }
  ASSERT_TRUE(solver.set_options({}).has_value());
  EXPECT_EQ(solver.solve().value().z, ours.z);
}

TEST(Reference, OnlyResearchRunsMethodsOfOthers) {
  const OwnedProblem p = testing::two_sides(1.0);
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  for (const Method method : kOthers) {
    const Options options{.method = method};
    EXPECT_TRUE(validate_ranges(options).has_value());
    const Error refused = solve_in_process(p.view(), options).error();
    EXPECT_EQ(refused.code, ErrorCode::invalid_argument);
    EXPECT_EQ(refused.field, "method");
    EXPECT_EQ(validate(options).error().message(), refused.message());
    EXPECT_EQ(solver.set_options(options).error().message(), refused.message());
  }
  EXPECT_EQ(validate({.method = Method::alag}).error().message(),
            "method = alag: must be marble; `marble compare` and `marble reproduce` run the others");
  EXPECT_EQ(solver.solve().value().status, Status::solved) << "a refused method changes nothing";
}

TEST(Reference, ProgressReportsPenaltiesAndTauOrMu) {
  for (const Method method : kOthers) {
    testing::Rows rows;
    static_cast<void>(
        research::solve_in_process(testing::two_sides(1.0).view(), {.method = method}, {.progress = &rows}));
    ASSERT_GE(rows.rows.size(), 2U);
    const Progress& last = rows.rows.back();
    EXPECT_EQ(last.kappa > 0.0, is_barrier(method));
    EXPECT_EQ(last.rho > 0.0, method != Method::relaxation && method != Method::plain_barrier);
  }
}

}  // namespace
}  // namespace marble
