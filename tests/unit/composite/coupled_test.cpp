// Coupled problems: what the blocks agree on, against the monolithic problem and dense algebra.
#include "marble/composite/coupled.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <limits>

#include "support/coupled_problems.h"
#include "support/dense_algebra.h"
#include "support/dense_matrix.h"
#include "support/independent_check.h"
#include "support/same_solution.h"
#include "support/threads.h"

namespace marble {
namespace {

using testing::random_coupled;

Eigen::MatrixXd dense(const SparseMatrix& m) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(m.rows, m.columns);
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      result(m.row_indices[k], j) = m.values[k];
  }
  return result;
}

Eigen::VectorXd vector(std::span<const double> values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// min ½x² + g x of one variable.
OwnedProblem one_variable(double curvature, double g) {
  OwnedProblem p;
  if (curvature != 0.0) p.Q = testing::sparse(Eigen::MatrixXd::Constant(1, 1, curvature));
  p.g = {g};
  return p;
}

struct TwoBlocks {
  OwnedProblem left = one_variable(1.0, 0.0), right = one_variable(1.0, 1.0);
  SparseMatrix left_rows = testing::sparse(Eigen::MatrixXd::Ones(1, 1)), right_rows = left_rows;
  std::vector<double> coupling_rhs = {1.0};

  [[nodiscard]] CoupledView view() const {
    return {{{"body", left.view(), left_rows.view()}, {"arm", right.view(), right_rows.view()}},
            coupling_rhs};
  }
};

std::string field_of_fault(const CoupledView& view) {
  const auto checked = check(view);
  return checked ? "" : checked.error().field;
}

TEST(Coupled, OneStepOfConvexBlocksWithoutPairsIsTheSolutionOfTheMonolithicKkt) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const testing::OwnedCoupled coupled =
        random_coupled({.blocks = 4, .variables = 5, .pairs = 0, .rows = 3}, seed);
    CoupledOptions options;
    options.monolithic = false, options.max_searches = 0;
    const CoupledSolution answer = solve_coupled(coupled.view(), options).value();
    ASSERT_EQ(answer.coordination.status, Status::solved) << answer.coordination.detail;
    EXPECT_EQ(answer.coordination.last.iteration, 2);

    Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(23, 23);
    Eigen::VectorXd right(23);
    for (Eigen::Index k = 0; k < 4; ++k) {
      const auto block = static_cast<std::size_t>(k);
      kkt.block(5 * k, 5 * k, 5, 5) = dense(coupled.blocks[block].Q);
      kkt.block(20, 5 * k, 3, 5) = dense(coupled.coupling[block]);
      right.segment(5 * k, 5) = -vector(coupled.blocks[block].g);
    }
    kkt.topRightCorner(20, 3) = kkt.bottomLeftCorner(3, 20).transpose();
    right.tail(3) = vector(coupled.coupling_rhs);
    const Eigen::VectorXd exact = testing::dense_solve(kkt, right);
    EXPECT_LE((vector(answer.monolithic.z) - exact.head(20)).cwiseAbs().maxCoeff(), 1e-8);
    EXPECT_LE((vector(answer.coupling_multipliers()) - exact.tail(3)).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(Coupled, RandomFamiliesEndAtTheMonolithicOptimumOrBetterAndAreJudgedSolved) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const testing::OwnedCoupled coupled = random_coupled({}, seed);
    const OwnedProblem monolithic = monolithic_problem(coupled.view());
    const Solution whole = solve_in_process(monolithic.view()).value();
    const CoupledSolution answer = solve_coupled(coupled.view()).value();
    ASSERT_TRUE(is_solved(answer.monolithic.status)) << seed << ": " << answer.monolithic.detail;
    EXPECT_LE(answer.monolithic.objective, whole.objective + 1e-6 * (1.0 + std::abs(whole.objective)))
        << seed;
    const testing::Verdict verdict = testing::judge(monolithic.view(), answer.monolithic);
    EXPECT_LE(verdict.infeasibility(), 1e-6) << seed;
    EXPECT_LE(verdict.stationarity, 1e-6) << seed;
    EXPECT_LE(verdict.slackness, 1e-6) << seed;
    EXPECT_NEAR(verdict.objective, answer.monolithic.objective, 1e-9 * (1.0 + std::abs(verdict.objective)));
  }
}

TEST(Coupled, HoppersThatShareABudgetOfForceKeepIt) {
  const double budget = 35.0;  // by themselves they need 44 N
  const testing::OwnedCoupled hoppers = testing::hoppers_on_a_budget(3, 20, budget);
  const CoupledSolution answer = solve_coupled(hoppers.view(), {.monolithic_search = false}).value();
  ASSERT_TRUE(is_solved(answer.monolithic.status)) << answer.monolithic.detail;
  EXPECT_EQ(answer.coordination.status, Status::solved) << answer.coordination.detail;
  const OwnedProblem monolithic = monolithic_problem(hoppers.view());
  const testing::Verdict verdict = testing::judge(monolithic.view(), answer.monolithic);
  EXPECT_LE(verdict.infeasibility(), 1e-6);
  EXPECT_LE(verdict.stationarity, 1e-6);
  EXPECT_GE(*std::ranges::max_element(answer.coupling_multipliers()), 1e-3) << "the budget binds";
}

/// ½ force² − force + gap / 10 of (force, gap), 0 ≤ force ⊥ gap ≥ 0: no curvature of the gap.
OwnedProblem pusher() {
  OwnedProblem p;
  p.Q = {2, 2, {0, 1, 1}, {0}, {1.0}};
  p.g = {-1.0, 0.1};
  p.L = {1, 2, {0, 1, 1}, {0}, {1.0}}, p.l = {0.0};
  p.R = {1, 2, {0, 0, 1}, {0}, {1.0}}, p.r = {0.0};
  return p;
}

TEST(Coupled, OfEqualBlocksOneTakesTheOtherSideWhereTheRowsAskForBoth) {
  const OwnedProblem arm = pusher();
  const SparseMatrix both = testing::sparse(Eigen::MatrixXd::Identity(2, 2));
  const std::vector<double> coupling_rhs = {1.0, 1.0};  // one pushes, and the other leaves its gap
  const CoupledView view{{{"left", arm.view(), both.view()}, {"right", arm.view(), both.view()}},
                         coupling_rhs};
  for (const bool monolithic : {false, true}) {
    CoupledOptions options;
    options.monolithic = monolithic;
    const CoupledSolution answer = solve_coupled(view, options).value();
    EXPECT_EQ(answer.coordination.status, Status::solved) << answer.coordination.detail;
    EXPECT_EQ(answer.coordination.pair_switches, 1);
    ASSERT_TRUE(is_solved(answer.monolithic.status)) << answer.monolithic.detail;
    EXPECT_NEAR(answer.monolithic.objective, -0.4, 1e-8);
  }
}

TEST(Coupled, ASideOnWhichABlockHasNoAnswerIsNotTaken) {
  OwnedProblem stuck = pusher();  // whose gap is at most a half: the other one's must be 1
  stuck.C = {1, 2, {0, 0, 1}, {0}, {-1.0}}, stuck.d = {0.5};
  OwnedProblem held = pusher();  // whose force is at least a tenth: its gap is zero
  held.C = {1, 2, {0, 1, 1}, {0}, {1.0}}, held.d = {-0.1};
  const OwnedProblem free = pusher();
  const SparseMatrix both = testing::sparse(Eigen::MatrixXd::Identity(2, 2));
  const std::vector<double> coupling_rhs = {1.0, 1.0};
  const CoupledView view{{{"held", held.view(), both.view()},
                          {"stuck", stuck.view(), both.view()},
                          {"free", free.view(), both.view()}},
                         coupling_rhs};
  const CoupledSolution answer = solve_coupled(view).value();
  EXPECT_EQ(answer.coordination.status, Status::solved) << answer.coordination.detail;
  ASSERT_TRUE(is_solved(answer.monolithic.status)) << answer.monolithic.detail;
  EXPECT_LE(testing::judge(monolithic_problem(view).view(), answer.monolithic).infeasibility(), 1e-6);
}

TEST(Coupled, ThreadsChangeNoBit) {
  const testing::OwnedCoupled coupled =
      random_coupled({.blocks = 5, .variables = 8, .pairs = 3, .rows = 4}, 7);
  testing::Threads threads(3);
  const CoupledSolution many = solve_coupled(coupled.view(), {}, {.runner = &threads}).value();
  const CoupledSolution one = solve_coupled(coupled.view()).value();
  testing::expect_same_bits(many.monolithic, one.monolithic);
  EXPECT_EQ(many.coordination.coupling_multipliers, one.coordination.coupling_multipliers);
  EXPECT_EQ(many.coordination.last.factorizations, one.coordination.last.factorizations);
  EXPECT_EQ(many.blocks_objective, one.blocks_objective);
}

TEST(Coupled, AStartAtTheAnswerAgreesAtOnce) {
  const testing::OwnedCoupled coupled = random_coupled({}, 3);
  CoupledOptions options;
  options.max_searches = 0;
  const CoupledSolution first = solve_coupled(coupled.view(), options).value();
  ASSERT_EQ(first.coordination.status, Status::solved);
  CoupledStart start{first.coordination.coupling_multipliers, {}};
  for (const BlockAnswer& answer : first.coordination.answers) start.blocks.push_back(answer.solution);
  const CoupledSolution again = solve_coupled(coupled.view(), options, {.start = &start}).value();
  EXPECT_EQ(again.coordination.status, Status::solved);
  EXPECT_LE(again.coordination.last.iteration, 2);
  EXPECT_NEAR(again.monolithic.objective, first.monolithic.objective, 1e-8);
}

TEST(Coupled, AnInfeasibleBlockIsNamedWithItsProof) {
  TwoBlocks blocks;
  blocks.right.C = testing::sparse(Eigen::MatrixXd{{1.0}, {-1.0}});
  blocks.right.d = {-1.0, 0.0};  // x >= 1 and x <= 0
  const CoupledSolution answer = solve_coupled(blocks.view()).value();
  EXPECT_EQ(answer.monolithic.status, Status::infeasible);
  EXPECT_EQ(answer.coordination.failed_block, 1U);
  EXPECT_TRUE(answer.monolithic.detail.starts_with("block 1 (arm) is infeasible by itself"))
      << answer.monolithic.detail;
  // (y, ν): of the coupling row, then of the inequalities: νᵀC = 0 and νᵀd < 0.
  const std::vector<double>& proof = answer.monolithic.certificate;
  ASSERT_EQ(proof.size(), 3U);
  EXPECT_EQ(proof[0], 0.0);
  EXPECT_NEAR(proof[1], proof[2], 1e-9 * proof[1]);
  EXPECT_GT(proof[1], 0.0);
}

TEST(Coupled, AnUnboundedBlockThatNoRowHoldsIsNamed) {
  TwoBlocks blocks;
  blocks.right = one_variable(0.0, -1.0);
  blocks.right_rows = {};
  const CoupledSolution answer = solve_coupled(blocks.view()).value();
  EXPECT_EQ(answer.monolithic.status, Status::unbounded);
  EXPECT_EQ(answer.coordination.failed_block, 1U);
  EXPECT_NE(answer.monolithic.detail.find("block 1 (arm) is unbounded by itself"), std::string::npos)
      << answer.monolithic.detail;
  CoupledOptions apart;
  apart.monolithic = false;
  const CoupledSolution unproved = solve_coupled(blocks.view(), apart).value();
  EXPECT_EQ(unproved.monolithic.status, Status::numerical_failure) << unproved.monolithic.detail;
  EXPECT_TRUE(unproved.monolithic.certificate.empty());
  EXPECT_EQ(unproved.coordination.failed_block, 1U);
}

// ½x² + ½y₀² + y₁ with 0 ≤ 8 − y₁ ⊥ y₀ + 2 ≥ 0 falls along −y₁ where y₀ is −2; the row x + y₀ = 1 and x ≤ 2
// permit that nowhere.
TEST(Coupled, ARayOfABranchThatTheRowsExcludeIsNoProof) {
  TwoBlocks blocks;
  blocks.left.C = testing::sparse(Eigen::MatrixXd{{-1.0}});
  blocks.left.d = {2.0};
  blocks.right = {};
  blocks.right.Q = testing::sparse(Eigen::Vector2d(1.0, 0.0).asDiagonal().toDenseMatrix());
  blocks.right.g = {0.0, 1.0};
  blocks.right.L = testing::sparse(Eigen::RowVector2d(0.0, -1.0));
  blocks.right.l = {8.0};
  blocks.right.R = testing::sparse(Eigen::RowVector2d(1.0, 0.0));
  blocks.right.r = {2.0};
  blocks.right_rows = testing::sparse(Eigen::RowVector2d(1.0, 0.0));
  const CoupledSolution answer = solve_coupled(blocks.view()).value();
  ASSERT_TRUE(is_solved(answer.monolithic.status)) << answer.monolithic.detail;
  EXPECT_NEAR(answer.monolithic.z[2], 8.0, 1e-8);
  EXPECT_FALSE(answer.coordination.failed_block.has_value());
}

TEST(Coupled, ABlockThatOnlyTheRowsHoldIsSolved) {
  TwoBlocks blocks;
  blocks.right = one_variable(0.0, -1.0);  // ½x² − y with x + y = 1: x = −1, y = 2
  const CoupledSolution answer = solve_coupled(blocks.view()).value();
  ASSERT_TRUE(is_solved(answer.monolithic.status)) << answer.monolithic.detail;
  EXPECT_NEAR(answer.monolithic.z[0], -1.0, 1e-8);
  EXPECT_NEAR(answer.monolithic.z[1], 2.0, 1e-8);
}

// ½x² − 50y² with 0·x + 1.5y = 0: the proximal term does not hold y, the row does.
TEST(Coupled, ABlockThatIsUnboundedOnlyWithoutTheRowsIsNotCalledUnbounded) {
  TwoBlocks blocks;
  blocks.right = one_variable(-100.0, 0.0);
  blocks.left_rows = {};
  blocks.right_rows = testing::sparse(Eigen::MatrixXd{{1.5}});
  blocks.coupling_rhs = {0.0};
  const CoupledSolution answer = solve_coupled(blocks.view()).value();
  ASSERT_TRUE(is_solved(answer.monolithic.status)) << answer.monolithic.detail;
  EXPECT_NEAR(answer.monolithic.z[1], 0.0, 1e-8);
  EXPECT_FALSE(answer.coordination.failed_block.has_value());
  const CoupledSolution alone = solve_coupled(blocks.view(), {.monolithic = false}).value();
  EXPECT_EQ(alone.monolithic.status, Status::numerical_failure) << alone.monolithic.detail;
  EXPECT_TRUE(alone.monolithic.certificate.empty());
}

TEST(Coupled, RowsThatContradictEachOtherAreInfeasibleAndNoBlockIsBlamed) {
  TwoBlocks blocks;
  blocks.left_rows = blocks.right_rows = testing::sparse(Eigen::MatrixXd::Ones(2, 1));
  blocks.coupling_rhs = {1.0, 2.0};
  const CoupledSolution answer = solve_coupled(blocks.view()).value();
  EXPECT_EQ(answer.monolithic.status, Status::infeasible) << answer.monolithic.detail;
  EXPECT_FALSE(answer.coordination.failed_block.has_value());
  EXPECT_TRUE(
      answer.monolithic.detail.starts_with("each block has an answer by itself, but not with the coupling"))
      << answer.monolithic.detail;
}

TEST(Coupled, AStopEndsItInTheNextIteration) {
  const testing::OwnedCoupled coupled = random_coupled({}, 1);
  std::stop_source stop;
  CoupledControls controls{.progress = [&](const CoupledIteration&) { stop.request_stop(); },
                           .stop = stop.get_token()};
  const CoupledSolution answer = solve_coupled(coupled.view(), {}, controls).value();
  EXPECT_EQ(answer.monolithic.status, Status::cancelled);
  EXPECT_LE(answer.coordination.last.iteration, 2);
}

TEST(Coupled, TheTimeLimitIsAnAnswerThatReportsHowFarItIs) {
  const testing::OwnedCoupled coupled = random_coupled({}, 1);
  CoupledOptions options;
  options.options.time_limit_s = 0.0;
  for (const bool monolithic : {true, false}) {
    options.monolithic = monolithic;
    const CoupledSolution answer = solve_coupled(coupled.view(), options).value();
    EXPECT_EQ(answer.monolithic.status, Status::time_limit);
    const OwnedProblem whole = monolithic_problem(coupled.view());
    const testing::Verdict verdict = testing::judge(whole.view(), answer.monolithic);
    EXPECT_GT(verdict.infeasibility(), 0.1);
    EXPECT_NEAR(answer.monolithic.violations.equality, verdict.equality, 1e-12);
  }
}

// A block's solver sees frozen sides as other rows: it reported complementarity 0 where min(s, t) was 0.77.
TEST(Coupled, ReportsTheViolationsOfABlockThatStopsEarlyByItsOwnRows) {
  OwnedProblem block;
  block.Q = testing::sparse(Eigen::MatrixXd{{1.0, 0.0}, {0.0, 4.0}});
  block.g = {1.0, -0.5};
  block.C = testing::sparse(Eigen::MatrixXd{{0.25, 1.5}, {-4.0, 10.0}, {0.0, 0.0}});
  block.d = {-12.5, -108.0, 1.0};
  block.L = testing::sparse(Eigen::MatrixXd{{1.0, 0.0}}), block.l = {2.0};
  block.R = testing::sparse(Eigen::MatrixXd{{0.0, 1.0}}), block.r = {-10.0};
  const SparseMatrix rows = testing::sparse(Eigen::MatrixXd{{-3.0, 0.0}, {0.0, -0.5}, {-1.0, -2.0}});
  CoupledOptions options{.max_iterations = 12, .freeze_after = 1, .max_searches = 1, .max_pair_switches = 2};
  options.options.max_iterations = 150;
  options.options.max_local_search_factorizations = options.options.max_feasibility_factorizations = 60;
  const std::vector<double> coupling_rhs(3, 0.0);
  const CoupledView view{{{"block", block.view(), rows.view()}}, coupling_rhs};
  const CoupledSolution answer = solve_coupled(view, options).value();
  const testing::Verdict verdict = testing::judge(monolithic_problem(view).view(), answer.monolithic);
  EXPECT_GT(verdict.complementarity, 0.1) << "solved by now: " << answer.monolithic.detail;
  EXPECT_NEAR(answer.monolithic.violations.equality, verdict.equality, 1e-9);
  EXPECT_NEAR(answer.monolithic.violations.inequality, verdict.inequality, 1e-9);
  EXPECT_NEAR(answer.monolithic.violations.complementarity, verdict.complementarity, 1e-9);
}

TEST(Coupled, BlocksThatDoNotAgreeReportByHowMuch) {
  const testing::OwnedCoupled coupled = random_coupled({}, 1);
  CoupledOptions options;
  options.monolithic = false, options.max_iterations = 1;
  const CoupledSolution answer = solve_coupled(coupled.view(), options).value();
  EXPECT_EQ(answer.monolithic.status, Status::iteration_limit);
  const OwnedProblem whole = monolithic_problem(coupled.view());
  const testing::Verdict verdict = testing::judge(whole.view(), answer.monolithic);
  EXPECT_GT(verdict.equality, 1e-3);
  EXPECT_NEAR(answer.monolithic.violations.equality, verdict.equality, 1e-12);
}

TEST(Coupled, MemoryIsThatOfAllBlocksTogetherAndOfTheMonolithicProblem) {
  const testing::OwnedCoupled coupled = random_coupled({.blocks = 8}, 1);
  const auto refusal = [&](std::int64_t bytes) {
    const auto answer = solve_coupled(coupled.view(), {}, {.setup = {.most_bytes = bytes}});
    return answer ? std::string() : answer.error().message();
  };
  const Problem one = Problem::create(coupled.view().blocks[0].problem).value();
  const std::int64_t bytes = Solver::create(one).value().memory_bytes();
  EXPECT_NE(refusal(4 * bytes).find("blocks["), std::string::npos) << refusal(4 * bytes);
  EXPECT_EQ(refusal(1000 * bytes), "");
}

TEST(Coupled, AFaultOfTheProblemIsNamed) {
  const TwoBlocks good;
  EXPECT_EQ(field_of_fault(good.view()), "");
  EXPECT_EQ(field_of_fault({}), "blocks");
  TwoBlocks bad = good;
  bad.coupling_rhs = {std::numeric_limits<double>::quiet_NaN()};
  EXPECT_EQ(field_of_fault(bad.view()), "coupling_rhs");
  bad = good;
  bad.coupling_rhs.assign(static_cast<std::size_t>(kMostCouplingRows) + 1, 0.0);
  EXPECT_EQ(field_of_fault(bad.view()), "coupling_rhs");
  EXPECT_NE(check(bad.view()).error().message().find("2000"), std::string::npos);
  bad = good;
  bad.right_rows.values[0] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(field_of_fault(bad.view()), "blocks[1].coupling.values");
  bad = good;
  bad.right_rows = testing::sparse(Eigen::MatrixXd::Ones(3, 1));
  EXPECT_EQ(field_of_fault(bad.view()), "blocks[1].coupling.rows");
  bad = good;
  bad.left.Q.values[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(field_of_fault(bad.view()), "blocks[0].problem.Q.values");
}

TEST(Coupled, AFaultOfTheOptionsIsNamed) {
  const auto fault = [](auto change) {
    CoupledOptions options;
    change(options);
    const auto answer = solve_coupled(TwoBlocks().view(), options);
    return answer ? "" : answer.error().field;
  };
  EXPECT_EQ(fault([](CoupledOptions& o) { o.proximal = 0.0; }), "proximal");
  EXPECT_EQ(fault([](CoupledOptions& o) { o.max_iterations = 0; }), "max_iterations");
  EXPECT_EQ(fault([](CoupledOptions& o) { o.freeze_after = -1; }), "freeze_after");
  EXPECT_EQ(fault([](CoupledOptions& o) { o.freeze_after = 0; }), "freeze_after");
  EXPECT_EQ(fault([](CoupledOptions& o) { o.max_searches = -1; }), "max_searches");
  EXPECT_EQ(fault([](CoupledOptions& o) { o.max_pair_switches = -1; }), "max_pair_switches");
  EXPECT_EQ(fault([](CoupledOptions& o) { o.tolerance = 1.0; }), "tolerance");
}

TEST(Coupled, AFaultOfTheStartIsNamed) {
  const TwoBlocks blocks;
  const auto fault = [&blocks](const CoupledStart& start) {
    const auto answer = solve_coupled(blocks.view(), {}, {.start = &start});
    return answer ? "" : answer.error().field;
  };
  Solution one;
  one.z = {0.0};
  EXPECT_EQ(fault({{0.0}, {one, one}}), "");
  EXPECT_EQ(fault({{0.0, 0.0}, {}}), "start.coupling_multipliers");
  EXPECT_EQ(fault({{}, {one}}), "start.blocks");
  EXPECT_EQ(fault({{}, {one, {}}}), "start.blocks[1].z");
}

}  // namespace
}  // namespace marble
