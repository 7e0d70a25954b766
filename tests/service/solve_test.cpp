// Solve: one problem, one answer.
#include "marble/convert.h"
#include "marble/solver.h"
#include "service_test.h"

namespace marble::testing {
namespace {

class Solve : public ServiceTest {};

TEST_F(Solve, AnswersWithTheOptimum) {
  start();
  v1::SolveResponse response;
  const grpc::Status status = solve(example_request(), &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  const v1::Solution& solution = response.solution();
  EXPECT_EQ(solution.status(), v1::STATUS_SOLVED);
  EXPECT_NEAR(solution.objective(), 3.0, 1e-4);
  ASSERT_EQ(solution.z_size(), 4);
  EXPECT_NEAR(solution.z(0), 1.0, 1e-4);
  EXPECT_EQ(solution.equality_multipliers_size(), 1);
  EXPECT_EQ(solution.inequality_multipliers_size(), 1);
  EXPECT_EQ(solution.complementarity_multipliers_l_size(), 1);
  EXPECT_EQ(solution.complementarity_multipliers_r_size(), 1);
  EXPECT_LE(solution.violations().complementarity(), 1e-6);
  EXPECT_FALSE(response.job_id().empty());
  EXPECT_GE(solution.times().total_s(), solution.times().queue_s());
}

TEST_F(Solve, GivesTheSameBitsAsTheLibraryInProcess) {
  start();
  const v1::SolveRequest request = long_request(50);
  v1::SolveResponse remote;
  ASSERT_TRUE(solve(request, &remote).ok());
  const auto problem = Problem::create(view_of(request.problem()));
  ASSERT_TRUE(problem.has_value());
  auto solver = Solver::create(*problem, options_of(request.options()).value());
  const Solution local = solver->solve().value();
  EXPECT_EQ(solution_of(remote.solution()).z, local.z);
  EXPECT_EQ(solution_of(remote.solution()).equality_multipliers, local.equality_multipliers);
  EXPECT_EQ(remote.solution().objective(), local.objective);
}

TEST_F(Solve, StartsAtTheInitialPoint) {
  start();
  v1::SolveRequest request = example_request();
  request.mutable_options()->set_max_iterations(0);
  for (const double z : {1.0, 4.0, 0.0, 1.0}) request.mutable_initial_point()->add_z(z);
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_ITERATION_LIMIT);
  ASSERT_EQ(response.solution().z_size(), 4);
  EXPECT_NEAR(response.solution().z(1), 4.0, 1e-12);
}

TEST_F(Solve, ReportsTheOptionsThatWereUsedDefaultsIncluded) {
  start();
  v1::SolveRequest request = example_request();
  request.mutable_options()->set_equality_tolerance(1e-8);
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_EQ(response.solution().options().equality_tolerance(), 1e-8);
  EXPECT_EQ(response.solution().options().inequality_tolerance(), Options().inequality_tolerance);
  EXPECT_TRUE(response.solution().options().has_max_iterations());
}

TEST_F(Solve, EndsWithTheBestIterateAtTheIterationLimit) {
  start();
  v1::SolveResponse response;
  ASSERT_TRUE(solve(long_request(3), &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_ITERATION_LIMIT);
  EXPECT_EQ(response.solution().iterations(), 3);
  EXPECT_EQ(response.solution().z_size(), long_request().problem().gradient_size());
}

TEST_F(Solve, EndsWithTheBestIterateAtTheTimeLimit) {
  start();
  v1::SolveRequest request = long_request();
  request.mutable_options()->set_time_limit_s(0.05);
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_TIME_LIMIT);
  EXPECT_EQ(response.solution().z_size(), request.problem().gradient_size());
}

TEST_F(Solve, LogsOneLineAJobWithTheClientsOwnId) {
  start({"--log-format", "json"});
  v1::SolveRequest request = example_request();
  request.set_request_id("tick 17");
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  const std::vector<std::string> own = {"\"event\":\"job\"", response.job_id()};
  ASSERT_TRUE(eventually([&] { return !server().log_lines(own).empty(); }));
  const auto lines = server().log_lines(own);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("\"request\":\"tick 17\""), std::string::npos) << lines[0];
  EXPECT_NE(lines[0].find("\"status\":\"solved\""), std::string::npos) << lines[0];
}

TEST_F(Solve, NoClientCanForgeALogLine) {
  start();
  v1::SolveRequest request = example_request();
  request.mutable_problem()->set_name("x\njob job=\"forged\"\x1b[2J");
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_TRUE(eventually([&] { return server().log_lines({response.job_id()}).size() == 1; }));
  EXPECT_TRUE(server().log_lines({"job=\"forged\""}).empty()) << server().log();
  EXPECT_EQ(server().log().find('\x1b'), std::string::npos);
}

TEST_F(Solve, WorksOverAUnixSocket) {
  const TemporaryDirectory directory;
  const std::string address = "unix:" + directory.file("socket");
  start({"--listen", address});
  EXPECT_EQ(server().address(), address);
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
