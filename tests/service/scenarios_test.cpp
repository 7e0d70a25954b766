// SolveScenarios: one plan for many scenarios, stage by stage.
#include <algorithm>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "jobs_client.h"
#include "marble/convert.h"
#include "marble/convert_scenarios.h"
#include "marble/scenario_examples.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

// The rocket, by the altitude of its trigger.
class Scenarios : public JobsServiceTest {
 protected:
  static inline const examples::OneNumberScenarios rocket = examples::rocket_by_altitude();

  [[nodiscard]] static std::vector<double> altitudes(int scenarios) {
    std::vector<double> result;
    for (int j = 0; j < scenarios; ++j) result.push_back(3.0 + 1.8 * ((5 * j) % scenarios + 0.5) / scenarios);
    return result;
  }
  [[nodiscard]] static v1::SolveRequest request(const std::vector<double>& numbers,
                                                const ScenarioSettings& settings) {
    const ScenarioProblem problem = rocket.scenarios(numbers);
    v1::SolveRequest result;
    to_message(problem.base, result.mutable_problem());
    to_message(settings, result.mutable_scenarios());
    EXPECT_TRUE(to_message(problem, problem.scenarios, result.mutable_scenarios()));
    return result;
  }
  /// Stages that do not come to their end while a test looks.
  [[nodiscard]] static v1::SolveRequest long_stages() {
    return request(altitudes(1999), {.growth = 1.1, .max_sample_size = 1999, .out_of_sample_scenarios = 0});
  }

  const TemporaryDirectory directory_;

  struct Reported {
    std::vector<v1::SampleAverageStage> stages;
    v1::SolveResponse result;
    grpc::Status status;
    std::int64_t rows = 0;
  };
  Reported solve_scenarios(const v1::SolveRequest& solve) {
    grpc::ClientContext context;
    v1::SolveStreamRequest request;
    *request.mutable_solve() = solve;
    const auto reader = solver().SolveScenarios(&context, request);
    Reported reported;
    for (Event event; reader->Read(&event);) {
      if (event.has_stage()) reported.stages.push_back(event.stage());
      if (event.has_result()) reported.result = event.result();
      for (const v1::Progress& row : event.progress().rows()) {
        EXPECT_GE(row.scenarios(), 1);
        ++reported.rows;
      }
    }
    reported.status = reader->Finish();
    return reported;
  }

  /// The answer of the server, with so many workers, is core's to the last bit.
  void expect_cores_bits(const char* workers) {
    start({"--workers", workers});
    const ScenarioSettings settings{.max_sample_size = 4};
    const std::vector<double> numbers = altitudes(24);
    const ScenarioSolution here = marble::solve_scenarios(rocket.scenarios(numbers), settings).value();
    const Reported reported = solve_scenarios(request(numbers, settings));
    ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
    const ScenarioSolution there = scenario_solution_of(reported.result.solution());
    EXPECT_EQ(there.x, here.x);
    EXPECT_EQ(there.recourse, here.recourse);
    EXPECT_EQ(there.objective, here.objective);
    EXPECT_EQ(there.solution.iterations, here.solution.iterations);
    ASSERT_EQ(there.stages.size(), here.stages.size());
    for (std::size_t k = 0; k < here.stages.size(); ++k) {
      EXPECT_EQ(there.stages[k].factorizations, here.stages[k].factorizations);
      EXPECT_EQ(there.stages[k].out_of_sample->mean, here.stages[k].out_of_sample->mean);
      EXPECT_EQ(there.stages[k].out_of_sample->half_width, here.stages[k].out_of_sample->half_width);
    }
  }
};

TEST_F(Scenarios, ReportStagesAndThenTheAnswer) {
  start();
  const Reported reported = solve_scenarios(request(altitudes(8), {.max_sample_size = 8}));
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  std::vector<std::int64_t> sizes;
  for (const v1::SampleAverageStage& stage : reported.stages) sizes.push_back(stage.scenarios());
  EXPECT_EQ(sizes, (std::vector<std::int64_t>{1, 2, 4, 8}));
  EXPECT_GT(reported.stages[1].out_of_sample().half_width(), 0.0);
  EXPECT_FALSE(reported.stages[3].has_out_of_sample()) << "there are no scenarios but these";
  EXPECT_GE(reported.rows, 1);
  const v1::Solution& solution = reported.result.solution();
  EXPECT_EQ(solution.status(), v1::STATUS_SOLVED);
  EXPECT_EQ(solution.scenarios().end(), v1::SCENARIO_END_SAMPLES);
  EXPECT_EQ(solution.scenarios().scenarios(), 8);
  EXPECT_EQ(solution.scenarios().first_stage(), static_cast<int>(rocket.first_stage.size()));
  EXPECT_EQ(solution.scenarios().stages_size(), 4);
  EXPECT_EQ(solution.z_size(), reported.stages[3].variables()) << "the plan, then each scenario's recourse";
  EXPECT_EQ(solution.complementarity_multipliers_l_size(), reported.stages[3].pairs());
  EXPECT_TRUE(eventually_idle());
  const v1::JobInfo job = get(reported.result.job_id()).job();
  EXPECT_EQ(job.kind(), v1::JOB_KIND_SCENARIOS);
  EXPECT_EQ(job.sample_average_stages_size(), 4);
}

TEST_F(Scenarios, HaveCoresBitsOnOneWorker) { expect_cores_bits("1"); }
TEST_F(Scenarios, HaveCoresBitsOnFourWorkers) { expect_cores_bits("4"); }

TEST_F(Scenarios, NameTheScenarioThatHasNoPlan) {
  start();
  const Reported reported = solve_scenarios(request({3.9, 4.2, 5.392, 4.0}, {}));
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  const v1::ScenarioOutcome& outcome = reported.result.solution().scenarios();
  EXPECT_EQ(outcome.end(), v1::SCENARIO_END_NOT_SOLVED);
  ASSERT_EQ(outcome.infeasible_size(), 1);
  EXPECT_EQ(outcome.infeasible(0), 2);
  EXPECT_EQ(outcome.scenarios(), 2) << "the plan of the stage before stays";
  EXPECT_GT(reported.result.solution().z_size(), 0);
}

TEST_F(Scenarios, AreDrawnByTheServerWhereASamplerIsNamed) {
  start();
  v1::SolveRequest sampled = request(altitudes(2), {.max_sample_size = 4, .out_of_sample_scenarios = 4});
  v1::ScenarioSampler* sampler = sampled.mutable_scenarios()->mutable_sampler();
  sampler->set_seed(7);
  v1::ScenarioQuantity* cost = sampler->add_quantities();
  cost->set_distribution(v1::ScenarioQuantity::DISTRIBUTION_NORMAL);
  cost->set_location(5.0);
  cost->set_most(6.0);
  v1::ScenarioEffect* effect = cost->add_effects();
  effect->mutable_entries()->set_part(v1::PROBLEM_PART_CONSTANT);
  effect->add_gains(10.0);
  v1::SolveResponse response;
  const grpc::Status status = solve(sampled, &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ScenarioProblem problem;
  problem.base = view_of(sampled.problem());
  ASSERT_TRUE(take_scenarios(sampled.scenarios(), problem));
  double mean = 0.0;
  for (int i = 0; i < 4; ++i) mean += (problem.sample(i)->c0.value() - problem.base.c0) / 4.0;
  EXPECT_LE(mean, 60.0);
  v1::SolveResponse plain;
  sampled.clear_scenarios();
  ASSERT_TRUE(solve(sampled, &plain).ok());
  EXPECT_NEAR(response.solution().objective(), plain.solution().objective() + mean, 1e-6);
}

TEST_F(Scenarios, AnswerWithTheNewestPlanWhenTheyAreReported) {
  start({"--workers", "1"});
  grpc::ClientContext context;
  v1::SolveStreamRequest request;
  *request.mutable_solve() = long_stages();
  const auto reader = solver().SolveScenarios(&context, request);
  std::string id;
  v1::SolveResponse result;
  bool reported = false;
  for (Event event; reader->Read(&event);) {
    if (event.has_accepted()) id = event.accepted().job_id();
    if (event.has_stage() && !std::exchange(reported, true)) {
      EXPECT_TRUE(cancel(id).ok());
    }
    if (event.has_result()) result = event.result();
  }
  ASSERT_TRUE(reader->Finish().ok());
  EXPECT_EQ(result.solution().status(), v1::STATUS_CANCELLED);
  EXPECT_EQ(result.solution().scenarios().end(), v1::SCENARIO_END_CANCELLED);
  EXPECT_GE(result.solution().scenarios().scenarios(), 1);
  EXPECT_GT(result.solution().z_size(), 0);
}

TEST_F(Scenarios, FreeTheirWorkerWhenTheirClientGoes) {
  start({"--workers", "1"});
  grpc::ClientContext context;
  v1::SolveStreamRequest request;
  *request.mutable_solve() = long_stages();
  const auto reader = solver().SolveScenarios(&context, request);
  for (Event event; reader->Read(&event) && !event.has_stage();) {
  }
  context.TryCancel();
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(eventually_idle());
  EXPECT_TRUE(lives());
}

TEST_F(Scenarios, EndWhenTheirTimeIsUp) {
  start();
  v1::SolveRequest limited = long_stages();
  limited.mutable_options()->set_time_limit_s(0.2);
  const Reported reported = solve_scenarios(limited);
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  EXPECT_EQ(reported.result.solution().status(), v1::STATUS_TIME_LIMIT);
  EXPECT_EQ(reported.result.solution().scenarios().end(), v1::SCENARIO_END_TIME_LIMIT);
}

TEST_F(Scenarios, MayBeSubmitted) {
  start();
  const std::string id = submit(request(altitudes(4), {}));
  v1::SolveResponse response;
  ASSERT_TRUE(result(id, true, &response).ok());
  EXPECT_EQ(response.solution().scenarios().scenarios(), 4);
  EXPECT_EQ(get(id).job().sample_average_stages_size(), 3);
  EXPECT_EQ(get(id).job().kind(), v1::JOB_KIND_SUBMITTED);
}

TEST_F(Scenarios, OutliveTheServerWhereItHasAStateDirectory) {
  start({"--state-dir", directory_.file("state")});
  const std::string id = submit(request(altitudes(4), {}));
  v1::SolveResponse before, after;
  ASSERT_TRUE(result(id, true, &before).ok());
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  start({"--state-dir", directory_.file("state")});
  ASSERT_TRUE(result(id, true, &after).ok());
  EXPECT_EQ(after.SerializeAsString(), before.SerializeAsString());
  EXPECT_EQ(get(id).job().sample_average_stages_size(), 3);
}

TEST_F(Scenarios, AreRefusedWithThePlaceOfTheFault) {
  start({"--scenarios", "64"});
  const v1::SolveRequest good = request(altitudes(4), {.max_sample_size = 4, .out_of_sample_scenarios = 4});
  const auto field = [&](const std::function<void(v1::SolveRequest&)>& spoil) {
    v1::SolveRequest bad = good;
    spoil(bad);
    const Reported reported = solve_scenarios(bad);
    EXPECT_EQ(reported.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT)
        << reported.status.error_message();
    return bad_field(reported.status).field();
  };
  using Request = v1::SolveRequest;
  const auto scenarios = [&](const std::function<void(v1::Scenarios&)>& spoil) {
    return field([&](Request& bad) { spoil(*bad.mutable_scenarios()); });
  };
  using S = v1::Scenarios;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(field([](Request& bad) { bad.clear_scenarios(); }), "solve.scenarios");
  EXPECT_EQ(field([](Request& bad) { bad.mutable_initial_point()->add_z(0.0); }), "solve.initial_point.z");
  EXPECT_EQ(field([](Request& bad) { bad.mutable_problem()->clear_gradient(); }), "solve.problem.gradient");
  EXPECT_EQ(scenarios([](S& bad) { bad.clear_first_stage(); }), "solve.scenarios.first_stage");
  EXPECT_EQ(scenarios([](S& bad) { bad.set_first_stage(1, -1); }), "solve.scenarios.first_stage[1]");
  EXPECT_EQ(scenarios([](S& bad) { bad.add_own_pairs(1 << 20); }), "solve.scenarios.own_pairs[0]");
  EXPECT_EQ(scenarios([](S& bad) { bad.clear_scenarios(); }), "solve.scenarios.samples");
  EXPECT_EQ(scenarios([](S& bad) { bad.mutable_samples()->set_values(2, kNone); }),
            "solve.scenarios.samples.values[2]");
  EXPECT_EQ(scenarios([](S& bad) { bad.mutable_samples()->add_values(1.0); }),
            "solve.scenarios.samples.values");
  EXPECT_EQ(scenarios([](S& bad) {
              bad.mutable_samples()->mutable_entries(0)->set_part(v1::PROBLEM_PART_UNSPECIFIED);
            }),
            "solve.scenarios.samples.entries[0].part");
  EXPECT_EQ(scenarios([](S& bad) { bad.mutable_samples()->mutable_entries(0)->set_positions(0, 1 << 20); }),
            "solve.scenarios.samples.entries[0].positions[0]");
  EXPECT_EQ(scenarios([](S& bad) { bad.mutable_samples()->add_weights(1.0); }),
            "solve.scenarios.samples.weights");
  EXPECT_EQ(scenarios([](S& bad) { bad.mutable_sampler()->set_seed(1); }),
            "solve.scenarios.sampler.quantities");
  EXPECT_EQ(scenarios([](S& bad) { bad.mutable_sampler()->add_quantities(); }),
            "solve.scenarios.sampler.quantities[0].effects");
  EXPECT_EQ(scenarios([](S& bad) { bad.set_growth(1.0); }), "solve.scenarios.growth");
  EXPECT_EQ(scenarios([](S& bad) { bad.set_max_sample_size(0); }), "solve.scenarios.max_sample_size");
  EXPECT_EQ(scenarios([](S& bad) { bad.set_tolerance(kNone); }), "solve.scenarios.tolerance");
  EXPECT_EQ(scenarios([](S& bad) { bad.set_min_sample_size(0); }), "solve.scenarios.min_sample_size");
  EXPECT_EQ(scenarios([](S& bad) { bad.set_out_of_sample_scenarios(-1); }),
            "solve.scenarios.out_of_sample_scenarios");
  v1::SolveRequest many = good;
  many.mutable_scenarios()->set_max_sample_size(61);
  EXPECT_EQ(solve_scenarios(many).status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(lives());
}

TEST_F(Scenarios, LeaveThePlansOwnRowsAlone) {
  start();
  v1::SolveRequest bad;
  *bad.mutable_problem() = example_request().problem();
  bad.mutable_scenarios()->add_first_stage(0);
  v1::ScenarioSamples* samples = bad.mutable_scenarios()->mutable_samples();
  samples->add_entries()->set_part(v1::PROBLEM_PART_EQUALITY_OFFSET);
  samples->add_values(-1.0);
  const Reported reported = solve_scenarios(bad);
  EXPECT_EQ(reported.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT)
      << reported.status.error_message();
  EXPECT_EQ(bad_field(reported.status).field(), "solve.scenarios.samples.entries[0].positions[0]");
  bad.mutable_scenarios()->add_own_equalities(0);
  EXPECT_TRUE(solve_scenarios(bad).status.ok());
}

// A diagonal Q of n entries, and one number that moves all of g: about 33 bytes a variable.
v1::SolveRequest large_scenarios(int n, std::int64_t first) {
  v1::SolveRequest request;
  v1::SparseMatrix& hessian = *request.mutable_problem()->mutable_hessian();
  hessian.set_rows(n);
  hessian.set_columns(n);
  for (int j = 0; j < n; ++j) {
    request.mutable_problem()->add_gradient(1.0 + j % 7);
    hessian.add_column_pointers(j);
    hessian.add_row_indices(j);
    hessian.add_values(2.0);
  }
  hessian.add_column_pointers(n);
  v1::Scenarios& scenarios = *request.mutable_scenarios();
  scenarios.add_first_stage(0);
  v1::ScenarioQuantity& quantity = *scenarios.mutable_sampler()->add_quantities();
  quantity.set_distribution(v1::ScenarioQuantity::DISTRIBUTION_NORMAL);
  auto& effect = *quantity.add_effects();
  effect.mutable_entries()->set_part(v1::PROBLEM_PART_GRADIENT);
  effect.add_gains(1.0);
  scenarios.set_initial_sample_size(first);
  scenarios.set_max_sample_size(4000);
  scenarios.set_growth(4000.0);
  scenarios.set_out_of_sample_scenarios(16);
  return request;
}

TEST_F(Scenarios, InitialSampleThatDoesNotFitIsRefusedWithItsSize) {
  start();
  const Reported reported = solve_scenarios(large_scenarios(30'000, 4000));
  EXPECT_EQ(reported.status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  for (const char* part : {"solve.scenarios.initial_sample_size", "4000 scenarios", "4294967296 bytes"})
    EXPECT_NE(reported.status.error_message().find(part), std::string::npos)
        << reported.status.error_message();
  EXPECT_LE(resident_bytes(server().pid()), std::int64_t{400} << 20) << "nothing of it was built";
  EXPECT_TRUE(lives());
}

TEST_F(Scenarios, LaterStageThatDoesNotFitEndsWithTheAnswerSoFar) {
  start({"--workers", "1", "--solve-bytes", "300000000"});
  ASSERT_TRUE(lives());
  const std::int64_t before = resident_bytes(server().pid());
  const Reported reported = solve_scenarios(large_scenarios(20'000, 1));
  ASSERT_TRUE(reported.status.ok()) << reported.status.error_message();
  const ScenarioSolution answer = scenario_solution_of(reported.result.solution());
  EXPECT_EQ(answer.end, ScenarioEnd::too_large);
  EXPECT_EQ(answer.status, Status::solved);
  EXPECT_EQ(answer.scenarios, 1);
  EXPECT_LE(resident_bytes(server().pid()) - before, 300'000'000 + (std::int64_t{100} << 20));
}

}  // namespace
}  // namespace marble::testing
