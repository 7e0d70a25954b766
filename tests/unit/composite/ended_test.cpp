#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <random>
#include <stop_token>
#include <vector>

#include "composite/dense.h"
#include "marble/composite/coupled.h"
#include "marble/composite/lifted_block.h"
#include "marble/composite/segments.h"
#include "marble/examples.h"
#include "marble/scenario_examples.h"
#include "path/memory_budget.h"
#include "support/coupled_problems.h"
#include "support/dense_matrix.h"

namespace marble {
namespace {

// A stop ends a coupled solve inside its dense algebra, and its memory is refused before it is built.
Eigen::MatrixXd random_symmetric(Index n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Eigen::MatrixXd a =
      Eigen::MatrixXd::NullaryExpr(n, n, [&] { return static_cast<double>(random() >> 11) * 0x1p-52 - 1.0; });
  return a + Eigen::MatrixXd(a.transpose());
}

Interrupt already() {
  std::stop_source source;
  source.request_stop();
  return Interrupt(source.get_token());
}

TEST(CoupledAlgebra, EigenDecompositionsAreThoseOfEigen) {
  for (const Index n : {1, 2, 3, 7, 40, 120}) {
    for (const double scale : {1.0, 1e150, 1e-150, 0.0}) {
      const Eigen::MatrixXd a = scale * random_symmetric(n, static_cast<std::uint64_t>(n));
      Eigen::MatrixXd vectors = a;
      Eigen::VectorXd values;
      ASSERT_TRUE(eigen_decomposition(vectors, values, {}));
      const double size = std::max(a.norm(), 1e-300);
      EXPECT_LE((vectors * values.asDiagonal() * vectors.transpose() - a).norm() / size, 1e-12) << n;
      EXPECT_LE((vectors.transpose() * vectors - Eigen::MatrixXd::Identity(n, n)).norm(), 1e-12) << n;
      Eigen::MatrixXd product(n, n);
      ASSERT_TRUE(spectral_product(vectors, values, product, {}));
      EXPECT_LE((product - a).norm() / size, 1e-12) << n;
      std::ranges::sort(values);
      EXPECT_LE((values - Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues()).norm() / size,
                1e-12);
    }
  }
}

TEST(CoupledAlgebra, SemidefiniteSystemsAreSolvedAsEigenDoes) {
  for (const Index n : {0, 1, 2, 5, 60}) {
    for (const Index rank : {n, n / 2}) {
      const Eigen::MatrixXd root = random_symmetric(n, 3).leftCols(rank);
      const Eigen::MatrixXd a = root * root.transpose();
      const Eigen::VectorXd b = a * Eigen::VectorXd::Ones(n);
      Eigen::MatrixXd factor = a;
      Eigen::VectorXd x = b;
      ASSERT_TRUE(solve_semidefinite(factor, x, {}));
      EXPECT_LE((a * x - b).norm(), 1e-9 * (1.0 + b.norm())) << n << ", rank " << rank;
      if (n > 0) {
        EXPECT_LE((x - a.ldlt().solve(b)).norm(), 1e-6 * (1.0 + x.norm())) << n << ", rank " << rank;
      }
    }
  }
}

TEST(CoupledAlgebra, StopsAreSeenInside) {
  const Eigen::MatrixXd a = random_symmetric(700, 1);
  Eigen::MatrixXd vectors = a;
  Eigen::VectorXd values = Eigen::VectorXd::Ones(700);
  EXPECT_FALSE(eigen_decomposition(vectors, values, already()));
  vectors = a;
  EXPECT_FALSE(solve_semidefinite(vectors, values, already()));
  std::stop_source source;
  source.request_stop();
  std::vector<double> large(600 * 600, 0.0);
  for (std::size_t i = 0; i < 600; ++i) large[i * 601] = 0.5;
  EXPECT_TRUE(without_proximal(large, 600, 1.0, {.stop = source.get_token()}).empty());
  EXPECT_EQ(without_proximal(large, 600, 1.0).size(), large.size());
}

// Blocks whose solves are counted, and of which one requests the stop.
TEST(CoupledStops, EndTheRemainingBlocksWithoutTheirWork) {
  const testing::OwnedCoupled c = testing::random_coupled({.blocks = 40, .rows = 3}, 2);
  for (const int last : {1, 10, 41, 50, 95}) {
    std::stop_source source;
    std::atomic<int> solves = 0;
    struct Counted final : BlockSolver {
      Expected<Solution> solve(const ProblemUpdate& update, const Solution* start) override {
        if (++*solves == last) source->request_stop();
        if (solver && !solver->update(update)) return unexpected(invalid("update", "must fit"));
        if (!solver) solver.emplace(Solver::create(Problem::create(block->problem().view()).value()).value());
        return solver->solve({.warm_start = start});
      }
      std::atomic<int>* solves = nullptr;
      std::stop_source* source = nullptr;
      const LiftedBlock* block = nullptr;
      int last = 0;
      std::optional<Solver> solver;
    };
    CoupledControls controls;
    controls.stop = source.get_token();
    controls.open = [&](const LiftedBlock& block) -> Expected<std::unique_ptr<BlockSolver>> {
      auto made = std::make_unique<Counted>();
      made->solves = &solves, made->source = &source, made->block = &block, made->last = last;
      return made;
    };
    const auto answer = solve_coupled(c.view(), {}, controls);
    ASSERT_TRUE(answer) << answer.error().message();
    EXPECT_EQ(answer->monolithic.status, Status::cancelled) << last << ": " << answer->monolithic.detail;
    EXPECT_EQ(answer->coordination.status, Status::cancelled) << last;
    EXPECT_EQ(solves, last) << "no block is solved after the stop";
    EXPECT_EQ(answer->monolithic.z.size(), 160U);
  }
}

TEST(CoupledStops, EndTheAssemblyOfSegments) {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::MatrixXd::Identity(6, 6));
  p.g.assign(6, 1.0);
  const Problem problem = Problem::create(p.view()).value();
  std::stop_source source;
  source.request_stop();
  const std::vector<Index> stages = {0, 1, 2, 3, 4, 5};
  const auto segments = cut(problem, std::vector<Index>{0, 0, 0, 1, 1, 1}, {.stop = source.get_token()});
  ASSERT_FALSE(segments);
  EXPECT_EQ(segments.error().code, ErrorCode::cancelled);
  CoupledControls controls;
  controls.stop = source.get_token();
  const auto answer = solve_in_segments(problem, stages, {.num_segments = 2}, controls);
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_EQ(answer->whole.status, Status::cancelled);
}

TEST(CoupledMemory, DenseMatricesAreRefusedBeforeTheyAreBuilt) {
  constexpr Index kRows = 1500;
  OwnedProblem block;
  block.Q = testing::sparse(Eigen::MatrixXd::Identity(2, 2));
  block.g.assign(2, 1.0);
  SparseMatrix rows{kRows, 2, {0, kRows, kRows}, {}, std::vector<double>(kRows, 1.0)};
  for (Index row = 0; row < kRows; ++row) rows.row_indices.push_back(row);
  CoupledView view{{}, {}};
  const std::vector<double> coupling_rhs(kRows, 0.0);
  view.coupling_rhs = coupling_rhs;
  for (int k = 0; k < 500; ++k) view.blocks.push_back({"", block.view(), rows.view()});  // 36 GB of responses
  EXPECT_GT(working_bytes(view), std::int64_t{30} << 30);
  const auto refused = solve_coupled(view, {}, {.setup = {.most_bytes = std::int64_t{4} << 30}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(refused.error().field, "blocks");
  EXPECT_NE(refused.error().message().find("4294967296"), std::string::npos) << refused.error().message();
}

TEST(CoupledMemory, WhatIsMadeAtOnceStaysWithinTheBudget) {
  struct Made {
    std::int64_t bytes;
    [[nodiscard]] std::int64_t memory_bytes() const { return bytes; }
  };
  MemoryBudget budget(1000);
  const auto make = [](std::int64_t bytes) {
    return [bytes](std::int64_t most) -> Expected<Made> {
      if (bytes > most) return unexpected(failure(ErrorCode::resource_exhausted, "problem", "", ""));
      return Made{bytes};
    };
  };
  EXPECT_TRUE(budget.make(make(10)));
  EXPECT_TRUE(budget.make(make(900))) << "alone";
  EXPECT_FALSE(budget.make(make(91)));
  EXPECT_TRUE(budget.make(make(90)));
  budget.give_back(900);
  EXPECT_TRUE(budget.make(make(900)));
}

// Solves of many problems ask whether to make way for others in all their parts, and their time limits stand
// still meanwhile.
using Clock = std::chrono::steady_clock;

constexpr double kLimitS = 1e-3;  // less than any of these solves takes

// The clock of a solve that is paused all the time runs backwards, so no time limit is reached by it.
class Backwards final : public Pause {
 public:
  void look() override { ++looks_; }
  [[nodiscard]] Clock::duration paused() const override { return 1000 * (Clock::now() - begun_); }
  [[nodiscard]] int looks() const { return looks_; }

 private:
  const Clock::time_point begun_ = Clock::now();
  std::atomic<int> looks_ = 0;
};

TEST(Pauses, AreAskedForByEachBlock) {
  const testing::OwnedCoupled c =
      testing::random_coupled({.blocks = 6, .variables = 40, .pairs = 12, .rows = 4}, 7);
  const CoupledSolution free = solve_coupled(c.view()).value();
  Backwards pause;
  CoupledOptions options;
  options.options.time_limit_s = kLimitS;
  const CoupledSolution paused = solve_coupled(c.view(), options, {.pause = &pause}).value();
  EXPECT_EQ(paused.monolithic.status, free.monolithic.status) << paused.monolithic.detail;
  EXPECT_EQ(paused.monolithic.z, free.monolithic.z);
  EXPECT_GE(pause.looks(), paused.coordination.last.factorizations + paused.monolithic.factorizations);
}

TEST(Pauses, AreAskedForInDenseAlgebra) {
  constexpr std::size_t kRows = 300;
  std::vector<double> response(kRows * kRows, 0.0);
  for (std::size_t i = 0; i < kRows; ++i) response[i * (kRows + 1)] = 0.5;
  Backwards pause;
  EXPECT_EQ(without_proximal(response, kRows, 1.0, {.pause = &pause}),
            without_proximal(response, kRows, 1.0));
  EXPECT_GE(pause.looks(), 10);
}

TEST(Pauses, AreAskedForByEachSegment) {
  constexpr int kSteps = 24;
  const OwnedProblem p = examples::hopper({.steps = kSteps});
  const Problem problem = Problem::create(p.view()).value();
  std::vector<Index> stages;
  for (Index j = 0; j < kSteps * examples::kHopperVariables; ++j)
    stages.push_back(j / examples::kHopperVariables);
  SegmentsOptions options{.num_segments = 3};
  const SegmentsSolution free = solve_in_segments(problem, stages, options).value();
  Backwards pause;
  options.coupled.options.time_limit_s = kLimitS;
  const SegmentsSolution paused = solve_in_segments(problem, stages, options, {.pause = &pause}).value();
  EXPECT_EQ(paused.whole.status, free.whole.status) << paused.whole.detail;
  EXPECT_EQ(paused.whole.z, free.whole.z);
  EXPECT_GE(pause.looks(), paused.sweep_factorizations + paused.coordination.last.factorizations +
                               paused.whole.factorizations);
}

TEST(Pauses, AreAskedForByEachStageAndRecourse) {
  const examples::OneNumberScenarios rocket = examples::rocket_by_altitude();
  const ScenarioProblem problem = rocket.scenarios({3.9, 3.4, 4.2, 3.6, 4.4, 3.2, 4.0, 3.8});
  ScenarioSettings settings{.max_sample_size = 4};
  const ScenarioSolution free = solve_scenarios(problem, settings).value();
  Backwards pause;
  settings.options.time_limit_s = kLimitS;
  const ScenarioSolution paused = solve_scenarios(problem, settings, {.pause = &pause}).value();
  EXPECT_EQ(paused.end, free.end) << paused.detail;
  EXPECT_EQ(paused.x, free.x);
  EXPECT_EQ(paused.recourse, free.recourse);
  EXPECT_GE(pause.looks(), paused.solution.factorizations);
  ASSERT_EQ(paused.stages.size(), free.stages.size());
  for (std::size_t k = 0; k < free.stages.size(); ++k)
    EXPECT_EQ(paused.stages[k].out_of_sample->mean, free.stages[k].out_of_sample->mean);
}

}  // namespace
}  // namespace marble
