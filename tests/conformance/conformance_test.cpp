// One suite, local and remote: the answer does not depend on where it was computed, to the last bit.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "marble/client.h"
#include "marble/examples.h"
#include "marble/macmpec.h"
#include "marble/solver.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

class Conformance : public ::testing::Test {
 protected:
  void expect_same(const OwnedProblem& problem, const Options& options = {}) {
    const Solution local = solve_in_process(problem.view(), options).value();
    const auto answer = client_->solve(problem.view(), options);
    ASSERT_TRUE(answer.has_value()) << problem.name << ": " << answer.error().message();
    const Solution& remote = *answer;
    EXPECT_EQ(local.status, remote.status) << problem.name;
    EXPECT_EQ(local.detail, remote.detail) << problem.name;
    EXPECT_EQ(local.z, remote.z) << problem.name;
    EXPECT_EQ(local.equality_multipliers, remote.equality_multipliers) << problem.name;
    EXPECT_EQ(local.inequality_multipliers, remote.inequality_multipliers) << problem.name;
    EXPECT_EQ(local.complementarity_multipliers_L, remote.complementarity_multipliers_L) << problem.name;
    EXPECT_EQ(local.complementarity_multipliers_R, remote.complementarity_multipliers_R) << problem.name;
    EXPECT_EQ(local.certificate, remote.certificate) << problem.name;
    EXPECT_EQ(local.objective, remote.objective) << problem.name;
    EXPECT_EQ(local.violations.equality, remote.violations.equality) << problem.name;
    EXPECT_EQ(local.violations.inequality, remote.violations.inequality) << problem.name;
    EXPECT_EQ(local.violations.complementarity, remote.violations.complementarity) << problem.name;
    EXPECT_EQ(local.kkt_residual, remote.kkt_residual) << problem.name;
    EXPECT_EQ(local.iterations, remote.iterations) << problem.name;
    EXPECT_EQ(local.factorizations, remote.factorizations) << problem.name;
  }

  ServerProcess server_{MARBLE_SERVER_BINARY};
  Expected<Client> client_ = Client::connect(server_.address());
};

TEST_F(Conformance, SmallProblems) {
  for (const auto& [problem, optimum] : small_problems()) expect_same(problem);
}

TEST_F(Conformance, KnownProblems) {
  for (const auto& [problem, optimum] : known_problems()) expect_same(problem);
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

TEST_F(Conformance, InitialPointMeansTheSame) {
  const OwnedProblem problem = public_example().problem;
  const std::vector<double> start = {1.0, 2.0, 0.5, 1.0};
  const SolveControls controls{nullptr, {}, start};
  const Solution local = solve_in_process(problem.view(), {}, controls).value();
  const auto remote = client_->solve(problem.view(), {}, controls);
  ASSERT_TRUE(remote.has_value()) << remote.error().message();
  EXPECT_EQ(local.z, remote->z);
  EXPECT_EQ(local.factorizations, remote->factorizations);
}

struct Rows final : ProgressSink {
  std::vector<std::vector<double>> rows;
  void report(const Progress& p) override {
    rows.push_back({static_cast<double>(p.iteration), static_cast<double>(p.outer_iteration), p.objective,
                    p.violations.equality, p.violations.inequality, p.violations.complementarity,
                    p.kkt_residual, p.kappa, p.rho, p.step_length, p.regularization,
                    static_cast<double>(p.factorizations)});
  }
};

TEST_F(Conformance, ProgressIsTheSame) {
  const OwnedProblem problem = examples::rocket();
  Rows local, remote;
  ASSERT_TRUE(solve_in_process(problem.view(), {}, {&local, {}, {}}).has_value());
  const auto answer = client_->solve(problem.view(), {}, {&remote, {}, {}});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_GT(local.rows.size(), 10U);
  if (answer->progress_skipped == 0) {
    EXPECT_EQ(local.rows, remote.rows);
  } else {
    EXPECT_EQ(local.rows.size(), remote.rows.size() + static_cast<std::size_t>(answer->progress_skipped));
    EXPECT_EQ(local.rows.back(), remote.rows.back());
  }
}

TEST_F(Conformance, ErrorsAreTheSame) {
  const auto expect_same_error = [this](const OwnedProblem& problem, const Options& options = {},
                                        std::span<const double> start = {}) {
    const auto local = solve_in_process(problem.view(), options, {nullptr, {}, start});
    const auto remote = client_->solve(problem.view(), options, {nullptr, {}, start});
    ASSERT_FALSE(local.has_value());
    ASSERT_FALSE(remote.has_value());
    EXPECT_EQ(local.error().code, remote.error().code);
    EXPECT_EQ(local.error().field, remote.error().field);
    EXPECT_EQ(local.error().index, remote.error().index);
    EXPECT_EQ(local.error().value, remote.error().value);
    EXPECT_EQ(local.error().bound, remote.error().bound);
  };
  const OwnedProblem good = public_example().problem;
  OwnedProblem bad = good;
  bad.A.row_indices[0] = 7;
  expect_same_error(bad);
  bad = good;
  bad.R.columns = 5;
  expect_same_error(bad);
  bad = good;
  bad.r.push_back(0.0);
  expect_same_error(bad);
  bad = good;
  bad.d[0] = std::numeric_limits<double>::infinity();
  expect_same_error(bad);
  bad = good;
  bad.g.clear();
  expect_same_error(bad);
  expect_same_error(good, {}, std::vector<double>{1.0});
  expect_same_error(good, {}, std::vector<double>{1.0, 2.0, std::nan(""), 4.0});
  Options options;
  options.kappa_factor = 7.0;
  expect_same_error(good, options);
  for (const double tolerance : {-1e-9, 1.0, std::nan("")}) {
    options = {};
    options.relative_gap_tolerance = tolerance;
    expect_same_error(good, options);
  }
  options = {};
  options.node_limit = 0;
  expect_same_error(good, options);
}

TEST_F(Conformance, Macmpec) {
  for (const examples::MacmpecProblem& each : examples::macmpec()) expect_same(each.problem());
}

}  // namespace
}  // namespace marble::testing
