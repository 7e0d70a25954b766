// SolveCoupled: problems that rows tie together, and a long one in segments.
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "jobs_client.h"
#include "marble/convert.h"
#include "marble/convert_coupled.h"
#include "marble/examples.h"
#include "support/coupled_problems.h"

namespace marble::testing {
namespace {

class CoupledCalls : public JobsServiceTest {
 protected:
  const OwnedCoupled cell_ = random_coupled({.blocks = 6, .variables = 8, .pairs = 3, .rows = 4}, 7);

  [[nodiscard]] v1::SolveRequest blocks() const {
    v1::SolveRequest request;
    to_message(cell_.view(), request.mutable_coupled());
    return request;
  }
  [[nodiscard]] static v1::SolveRequest segments(Index steps, Index count) {
    v1::SolveRequest request;
    to_message(examples::hopper({.steps = steps}).view(), request.mutable_problem());
    v1::Segments* segments = request.mutable_coupled()->mutable_segments();
    for (Index j = 0; j < steps * examples::kHopperVariables; ++j)
      segments->add_stages(j / examples::kHopperVariables);
    segments->set_num_segments(count);
    return request;
  }
  /// Blocks that go on and on: two pull at one row for different totals of it.
  [[nodiscard]] v1::SolveRequest endless() const {
    v1::SolveRequest request = blocks();
    request.mutable_coupled()->set_tolerance(1e-300);
    request.mutable_coupled()->set_freeze_after(1'000'000'000);
    request.mutable_coupled()->set_max_iterations(1'000'000'000);
    return request;
  }

  struct Reported {
    std::vector<v1::Progress> rows;
    v1::SolveResponse result;
    grpc::Status status;
  };
  Reported solve_coupled(const v1::SolveRequest& solve) {
    grpc::ClientContext context;
    v1::SolveStreamRequest request;
    *request.mutable_solve() = solve;
    const auto reader = solver().SolveCoupled(&context, request);
    Reported reported;
    for (Event event; reader->Read(&event);) {
      for (const v1::Progress& row : event.progress().rows()) reported.rows.push_back(row);
      if (event.has_result()) reported.result = event.result();
    }
    reported.status = reader->Finish();
    return reported;
  }

  /// The answer of the server, with so many workers, is core's to the last bit.
  void expect_cores_bits(const char* workers) {
    start({"--workers", workers});
    const CoupledSolution here = marble::solve_coupled(cell_.view()).value();
    const Reported reported = solve_coupled(blocks());
    ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
    const Solution there = solution_of(reported.result.solution());
    EXPECT_EQ(there.status, here.monolithic.status);
    EXPECT_EQ(there.z, here.monolithic.z);
    EXPECT_EQ(there.equality_multipliers, here.monolithic.equality_multipliers);
    EXPECT_EQ(there.objective, here.monolithic.objective);
    EXPECT_EQ(there.factorizations, here.monolithic.factorizations);
    const v1::CoupledOutcome& outcome = reported.result.solution().coupled();
    EXPECT_EQ(coordination_of(outcome).coupling_multipliers, here.coordination.coupling_multipliers);
    EXPECT_EQ(outcome.factorizations(), here.coordination.last.factorizations);
    EXPECT_EQ(outcome.blocks_objective(), here.blocks_objective);
  }
};

TEST_F(CoupledCalls, ReportEachIterationAndThenTheMonolithicAnswer) {
  start();
  const Reported reported = solve_coupled(blocks());
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  const v1::Solution& solution = reported.result.solution();
  EXPECT_EQ(solution.status(), v1::STATUS_SOLVED);
  EXPECT_EQ(solution.z_size(), 6 * 8);
  EXPECT_EQ(solution.coupled().status(), v1::STATUS_SOLVED) << solution.coupled().detail();
  EXPECT_EQ(solution.coupled().coupling_multipliers_size(), 4);
  ASSERT_FALSE(reported.rows.empty());
  const v1::Progress& last = reported.rows.back();
  EXPECT_LE(last.iteration(), solution.coupled().iterations());
  EXPECT_LE(last.violations().equality(), 1e-6);
  EXPECT_GT(last.rho(), 0.0);
  EXPECT_TRUE(eventually_idle());
  const v1::JobInfo job = get(reported.result.job_id()).job();
  EXPECT_EQ(job.kind(), v1::JOB_KIND_COUPLED);
  EXPECT_EQ(job.variables(), 6 * 8);
  EXPECT_EQ(job.pairs(), 6 * 3);
}

TEST_F(CoupledCalls, HaveCoresBitsOnOneWorker) { expect_cores_bits("1"); }
TEST_F(CoupledCalls, HaveCoresBitsOnFourWorkers) { expect_cores_bits("4"); }

TEST_F(CoupledCalls, MayHaveManyBlocks) {
  start();
  const OwnedCoupled many = random_coupled({.blocks = 50, .variables = 3, .pairs = 1, .rows = 2}, 1);
  v1::SolveRequest request;
  to_message(many.view(), request.mutable_coupled());
  const Reported reported = solve_coupled(request);
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  EXPECT_EQ(reported.result.solution().z_size(), 50 * 3);
}

TEST_F(CoupledCalls, SolveALongHorizonInSegments) {
  start();
  const Reported reported = solve_coupled(segments(24, 3));
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  const v1::Solution& solution = reported.result.solution();
  EXPECT_EQ(solution.status(), v1::STATUS_SOLVED) << solution.detail();
  EXPECT_EQ(solution.z_size(), 24 * examples::kHopperVariables);
  EXPECT_EQ(solution.coupled().status(), v1::STATUS_SOLVED) << solution.coupled().detail();
  EXPECT_NEAR(solution.coupled().blocks_objective(), solution.objective(), 1e-6 * solution.objective());
  EXPECT_GE(solution.coupled().sweep_objective(), solution.objective());
}

TEST_F(CoupledCalls, NameTheBlockThatHasNoAnswer) {
  start();
  v1::SolveRequest bad = blocks();
  v1::Problem* block = bad.mutable_coupled()->mutable_blocks(2)->mutable_problem();
  block->set_name("arm");
  const SparseMatrix contradiction{2, 8, {0, 2, 2, 2, 2, 2, 2, 2, 2}, {0, 1}, {1.0, -1.0}};
  to_message(contradiction.view(), block->mutable_inequality_matrix());
  block->clear_inequality_offset();
  for (const double d : {-1.0, 0.0}) block->add_inequality_offset(d);
  const Reported reported = solve_coupled(bad);
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  EXPECT_EQ(reported.result.solution().status(), v1::STATUS_INFEASIBLE);
  EXPECT_EQ(reported.result.solution().coupled().failed_block(), 2);
  EXPECT_NE(reported.result.solution().detail().find("block 2 (arm)"), std::string::npos);
}

TEST_F(CoupledCalls, AnswerWithWhereTheBlocksAreWhenTheirTimeIsUp) {
  start();
  v1::SolveRequest limited = endless();
  limited.mutable_options()->set_time_limit_s(0.1);
  const Reported reported = solve_coupled(limited);
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  EXPECT_EQ(reported.result.solution().status(), v1::STATUS_TIME_LIMIT);
  EXPECT_EQ(reported.result.solution().z_size(), 6 * 8);
}

TEST_F(CoupledCalls, FreeTheirWorkersWhenTheirClientGoes) {
  start({"--workers", "2"});
  grpc::ClientContext context;
  v1::SolveStreamRequest request;
  *request.mutable_solve() = endless();
  const auto reader = solver().SolveCoupled(&context, request);
  for (Event event; reader->Read(&event) && !event.has_progress();) {
  }
  context.TryCancel();
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(eventually_idle());
  EXPECT_TRUE(lives());
}

// 200 blocks, each seen by 200 of 600 rows: one iteration has seconds of dense algebra.
TEST_F(CoupledCalls, EndInsideTheirDenseAlgebra) {
  start({"--workers", "1"});
  constexpr int kBlocks = 200, kVariables = 200, kRows = 600;
  v1::SolveRequest request;
  for (int k = 0; k < kBlocks; ++k) {
    v1::CoupledBlock* block = request.mutable_coupled()->add_blocks();
    SparseMatrix Q{kVariables, kVariables, {0}, {}, {}}, rows{kRows, kVariables, {0}, {}, {}};
    for (Index j = 0; j < kVariables; ++j) {
      Q.row_indices.push_back(j), Q.values.push_back(1.0 + 0.01 * j);
      rows.row_indices.push_back((j + 7 * k) % kRows), rows.values.push_back(1.0 + 0.01 * k);
      Q.column_pointers.push_back(j + 1), rows.column_pointers.push_back(j + 1);
      block->mutable_problem()->add_gradient(k - j);
    }
    to_message(Q.view(), block->mutable_problem()->mutable_hessian());
    to_message(rows.view(), block->mutable_coupling());
  }
  for (int row = 0; row < kRows; ++row) request.mutable_coupled()->add_coupling_rhs(1.0);
  request.mutable_coupled()->set_tolerance(1e-300);  // it goes on and on
  request.mutable_coupled()->set_freeze_after(1'000'000'000);
  request.mutable_coupled()->set_max_iterations(1'000'000'000);
  v1::SolveRequest limited = request;
  limited.mutable_options()->set_time_limit_s(0.2);
  const Reported reported = solve_coupled(limited);
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  EXPECT_EQ(reported.result.solution().status(), v1::STATUS_TIME_LIMIT);
  EXPECT_EQ(reported.result.solution().z_size(), kBlocks * kVariables);
  const std::string id = submit(request);
  ASSERT_TRUE(eventually([&] { return get(id).job().state() == v1::JOB_STATE_RUNNING; }));
  ASSERT_TRUE(cancel(id).ok());
  EXPECT_TRUE(eventually_idle());
  EXPECT_TRUE(lives());
}

TEST_F(CoupledCalls, MayBeSubmitted) {
  start();
  const std::string id = submit(blocks());
  v1::SolveResponse response;
  ASSERT_TRUE(result(id, true, &response).ok());
  EXPECT_EQ(response.solution().coupled().status(), v1::STATUS_SOLVED);
  EXPECT_EQ(get(id).job().kind(), v1::JOB_KIND_SUBMITTED);
  EXPECT_GT(get(id).trace().rows_size(), 0);
}

TEST_F(CoupledCalls, AreRefusedWithThePlaceOfTheFault) {
  start({"--coupled-blocks", "6"});
  const auto status = [&](const v1::SolveRequest& good, const std::function<void(v1::SolveRequest&)>& spoil) {
    v1::SolveRequest bad = good;
    spoil(bad);
    return solve_coupled(bad).status;
  };
  const auto field = [&](const v1::SolveRequest& good, const std::function<void(v1::SolveRequest&)>& spoil) {
    const grpc::Status refused = status(good, spoil);
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << refused.error_message();
    return bad_field(refused).field();
  };
  using Request = v1::SolveRequest;
  const auto of_blocks = [&](const std::function<void(v1::Coupled&)>& spoil) {
    return field(blocks(), [&](Request& bad) { spoil(*bad.mutable_coupled()); });
  };
  const auto of_segments = [&](const std::function<void(v1::Coupled&)>& spoil) {
    return field(segments(6, 2), [&](Request& bad) { spoil(*bad.mutable_coupled()); });
  };
  using C = v1::Coupled;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(field(blocks(), [](Request& bad) { bad.clear_coupled(); }), "solve.coupled");
  EXPECT_EQ(field(blocks(), [](Request& bad) { bad.mutable_problem()->add_gradient(0.0); }), "solve.problem");
  EXPECT_EQ(field(blocks(), [](Request& bad) { bad.mutable_initial_point()->add_z(0.0); }),
            "solve.initial_point.z");
  EXPECT_EQ(field(blocks(), [](Request& bad) { bad.mutable_warm_start(); }), "solve.warm_start");
  EXPECT_EQ(field(blocks(), [](Request& bad) { bad.mutable_scenarios(); }), "solve.scenarios");
  EXPECT_EQ(field(blocks(), [](Request& bad) { bad.mutable_sensitivity(); }), "solve.sensitivity");
  EXPECT_EQ(of_blocks([](C& bad) { bad.mutable_segments(); }), "solve.coupled.segments");
  EXPECT_EQ(of_blocks([](C& bad) { bad.set_coupling_rhs(2, kNone); }), "solve.coupled.coupling_rhs[2]");
  EXPECT_EQ(of_blocks([](C& bad) { bad.add_coupling_rhs(0.0); }), "solve.coupled.blocks[0].coupling.rows");
  EXPECT_EQ(of_blocks([](C& bad) { bad.mutable_blocks(1)->mutable_problem()->set_gradient(3, kNone); }),
            "solve.coupled.blocks[1].problem.gradient[3]");
  EXPECT_EQ(of_blocks([](C& bad) {
              bad.mutable_blocks(5)->mutable_problem()->mutable_left_matrix()->set_values(0, kNone);
            }),
            "solve.coupled.blocks[5].problem.left_matrix.values[0]");
  EXPECT_EQ(of_blocks([](C& bad) { bad.mutable_blocks(4)->mutable_coupling()->set_values(1, kNone); }),
            "solve.coupled.blocks[4].coupling.values[1]");
  EXPECT_EQ(of_blocks([](C& bad) { bad.add_coupling_multipliers(1.0); }),
            "solve.coupled.coupling_multipliers");
  EXPECT_EQ(of_blocks([](C& bad) { bad.set_proximal(-1.0); }), "solve.coupled.proximal");
  EXPECT_EQ(of_blocks([](C& bad) { bad.set_freeze_after(0); }), "solve.coupled.freeze_after");
  EXPECT_EQ(of_blocks([](C& bad) { bad.set_tolerance(1.0); }), "solve.coupled.tolerance");
  EXPECT_EQ(of_segments([](C& bad) { bad.clear_segments(); }), "solve.coupled.blocks");
  EXPECT_EQ(of_segments([](C& bad) { bad.mutable_segments()->add_stages(0); }),
            "solve.coupled.segments.stages");
  EXPECT_EQ(of_segments([](C& bad) { bad.mutable_segments()->set_stages(3, -1); }),
            "solve.coupled.segments.stages[3]");
  EXPECT_EQ(of_segments([](C& bad) { bad.mutable_segments()->set_num_segments(0); }),
            "solve.coupled.segments.num_segments");
  EXPECT_EQ(of_segments([](C& bad) { bad.mutable_segments()->set_overlap(-2); }),
            "solve.coupled.segments.overlap");
  EXPECT_EQ(of_segments([](C& bad) { bad.set_monolithic(false); }), "solve.coupled.monolithic");
  EXPECT_EQ(of_segments([](C& bad) { bad.add_coupling_rhs(0.0); }), "solve.coupled.segments");
  const auto many = [](Request& bad) { *bad.mutable_coupled()->add_blocks() = bad.coupled().blocks(0); };
  EXPECT_EQ(status(blocks(), many).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status(segments(7, 7), [](Request&) {}).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(lives());
}

class CoupledMemory : public CoupledCalls {
 protected:
  /// Why a server with so much memory for a solve refuses 30 blocks.
  std::string refusal(const char* solve_bytes) {
    start({"--solve-bytes", solve_bytes});
    const OwnedCoupled large = random_coupled({.blocks = 30, .variables = 40, .pairs = 10, .rows = 4}, 1);
    v1::SolveRequest request;
    to_message(large.view(), request.mutable_coupled());
    const grpc::Status refused = solve_coupled(request).status;
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << refused.error_message();
    EXPECT_TRUE(lives());
    return refused.error_message();
  }
};

TEST_F(CoupledMemory, OfMatricesAndCopiesIsRefusedBeforeTheyAreBuilt) {
  const std::string message = refusal("1048576");
  EXPECT_NE(message.find("coupled.blocks = "), std::string::npos) << message;
  EXPECT_NE(message.find("1048576 bytes (solve_bytes)"), std::string::npos) << message;
}

TEST_F(CoupledMemory, OfAllSolversTogetherIsThatOfOne) {
  const std::string message = refusal("3145728");
  EXPECT_NE(message.find("blocks["), std::string::npos) << message;
}

}  // namespace
}  // namespace marble::testing
