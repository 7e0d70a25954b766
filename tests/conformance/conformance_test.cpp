// One suite, local and remote: the answer does not depend on where it was computed, to the last bit.
#include <gtest/gtest.h>

#include <cstdlib>

#include "marble/client.h"
#include "marble/examples.h"
#include "marble/problem_file.h"
#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

class Conformance : public ::testing::Test {
 protected:
  void expect_same(const OwnedProblem& problem, const Options& options = {}) {
    const Solution local = solve(problem.view(), options).value();
    const auto answer = client_.solve(problem.view(), options);
    ASSERT_TRUE(answer.has_value()) << problem.name << ": " << answer.error().message();
    const Solution& remote = answer->solution;
    EXPECT_EQ(local.status, remote.status) << problem.name;
    EXPECT_EQ(local.detail, remote.detail) << problem.name;
    EXPECT_EQ(local.z, remote.z) << problem.name;
    EXPECT_EQ(local.equality_multipliers, remote.equality_multipliers) << problem.name;
    EXPECT_EQ(local.inequality_multipliers, remote.inequality_multipliers) << problem.name;
    EXPECT_EQ(local.complementarity_multipliers_L, remote.complementarity_multipliers_L) << problem.name;
    EXPECT_EQ(local.complementarity_multipliers_R, remote.complementarity_multipliers_R) << problem.name;
    EXPECT_EQ(local.certificate, remote.certificate) << problem.name;
    EXPECT_EQ(local.objective, remote.objective) << problem.name;
    EXPECT_EQ(local.kkt_residual, remote.kkt_residual) << problem.name;
    EXPECT_EQ(local.iterations, remote.iterations) << problem.name;
    EXPECT_EQ(local.factorizations, remote.factorizations) << problem.name;
  }

  ServerProcess server_{MARBLE_SERVER_BINARY};
  Client client_{server_.address()};
};

TEST_F(Conformance, SmallProblems) {
  for (const auto& [problem, optimum] : small_problems()) expect_same(problem);
}

TEST_F(Conformance, OptionsMeanTheSame) {
  Options options;
  options.path = Path::paper;
  options.kappa_initial = 0.5;
  options.scaling_passes = 3;
  options.polish = false;
  for (const auto& [problem, optimum] : small_problems()) expect_same(problem, options);
}

TEST_F(Conformance, RoboticsExamples) {
  expect_same(examples::hopper());
  expect_same(examples::rocket(examples::vary(examples::RocketParameters{}, 4)));
  expect_same(examples::gates());
}

TEST_F(Conformance, ErrorsAreTheSame) {
  OwnedProblem problem = public_example().problem;
  problem.A.row_indices[0] = 7;
  const Error local = solve(problem.view()).error();
  const Error remote = client_.solve(problem.view()).error();
  EXPECT_EQ(local.code, remote.code);
  EXPECT_EQ(local.field, remote.field);
  EXPECT_EQ(local.index, remote.index);
  EXPECT_EQ(local.value, remote.value);
  EXPECT_EQ(local.bound, remote.bound);
}

std::filesystem::path shared_benchmarks() {
  const char* shared = std::getenv("MARBLE_SHARED");
  return (shared != nullptr ? std::filesystem::path(shared)
                            : std::filesystem::path(MARBLE_SOURCE_DIR) / ".." / "shared") /
         "benchmarks" / "macmpec";
}

TEST_F(Conformance, MacMpecIsSolvedGloballyAndTheSameRemotely) {
  if (!std::filesystem::is_directory(shared_benchmarks()))
    GTEST_SKIP() << "no benchmark problems at " << shared_benchmarks();
  int problems = 0;
  int within = 0;
  for (const auto& entry : std::filesystem::directory_iterator(shared_benchmarks())) {
    const auto file = read_problem(entry.path().string());
    ASSERT_TRUE(file.has_value()) << entry.path() << ": " << file.error().message();
    ASSERT_TRUE(file->best_known_objective.has_value());
    ++problems;
    expect_same(file->problem);
    const Solution s = solve(file->problem.view()).value();
    const Verdict verdict = judge(file->problem.view(), s);
    EXPECT_LE(verdict.infeasibility(), 1e-9) << entry.path();
    const double best = *file->best_known_objective;
    if (verdict.objective <= best + 1e-5 * std::max(1.0, std::abs(best))) ++within;
  }
  EXPECT_EQ(problems, 39);
  EXPECT_EQ(within, problems) << "problems within 1e-5 of the best known objective";
}

}  // namespace
}  // namespace marble::testing
