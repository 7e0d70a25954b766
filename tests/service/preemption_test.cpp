// A session's control steps beside work of lower priority that takes all workers and does not end by itself.
#include <string>
#include <vector>

#include "bidi.h"
#include "jobs_client.h"
#include "marble/convert.h"
#include "marble/convert_coupled.h"
#include "marble/convert_scenarios.h"
#include "marble/examples.h"
#include "marble/scenario_examples.h"
#include "support/coupled_problems.h"

namespace marble::testing {
namespace {

v1::SolveRequest blocks() {
  v1::SolveRequest request;
  const OwnedCoupled cell = random_coupled({.blocks = 12, .variables = 60, .pairs = 20, .rows = 4}, 7);
  to_message(cell.view(), request.mutable_coupled());
  request.mutable_coupled()->set_tolerance(1e-300);
  request.mutable_coupled()->set_freeze_after(1'000'000'000);
  request.mutable_coupled()->set_max_iterations(1'000'000'000);
  return request;
}

v1::SolveRequest scenarios() {
  static const examples::OneNumberScenarios rocket = examples::rocket_by_altitude();
  std::vector<double> altitudes(1999);
  for (std::size_t j = 0; j < altitudes.size(); ++j)
    altitudes[j] = 3.0 + 1.8 * static_cast<double>((5 * j) % 1999) / 1999.0;
  const ScenarioProblem problem = rocket.scenarios(altitudes);
  v1::SolveRequest request;
  to_message(problem.base, request.mutable_problem());
  to_message(ScenarioSettings{.growth = 1.1, .max_sample_size = 1999, .out_of_sample_scenarios = 500},
             request.mutable_scenarios());
  EXPECT_TRUE(to_message(problem, problem.scenarios, request.mutable_scenarios()));
  return request;
}

v1::SolveRequest starts() {
  v1::SolveRequest request;
  to_message(examples::hopper().view(), request.mutable_problem());
  request.mutable_options()->set_num_starts(1000);
  return request;
}

v1::SolveRequest global() {
  v1::SolveRequest request;
  to_message(examples::gates().view(), request.mutable_problem());
  request.mutable_options()->set_global_search(true);
  return request;
}

class ControlSteps : public JobsServiceTest {
 protected:
  /// Twenty updates are answered while all of these jobs, of another session's client, go on.
  void expect_answers_beside(const char* workers, const std::vector<v1::SolveRequest>& jobs) {
    start({"--workers", workers, "--client-queued", "0"});
    Bidi<v1::SessionRequest, v1::SessionResponse> session(
        [this](grpc::ClientContext* context) { return solver().Session(context); });
    v1::SessionRequest setup;
    to_message(examples::hopper({.steps = 2}).view(), setup.mutable_setup()->mutable_problem());
    ASSERT_TRUE(session.write(setup));
    ASSERT_TRUE(session.next());
    std::vector<std::string> ids;
    for (v1::SolveRequest job : jobs) {
      job.set_priority(v1::PRIORITY_BATCH);
      ids.push_back(submit(job));
    }
    const std::size_t running = std::min(ids.size(), static_cast<std::size_t>(std::atoi(workers)));
    for (std::size_t k = 0; k < running; ++k)
      ASSERT_TRUE(eventually([&] { return get(ids[k]).job().state() == v1::JOB_STATE_RUNNING; })) << k;
    for (int step = 1; step <= 20; ++step) {
      v1::SessionRequest update;
      update.mutable_update()->set_sequence(step);
      ASSERT_TRUE(session.write(update));
      const auto answer = session.next();
      ASSERT_TRUE(answer && answer->has_answer()) << step;
      EXPECT_EQ(answer->answer().solution().status(), v1::STATUS_SOLVED);
    }
    for (const std::string& id : ids) {
      EXPECT_NE(get(id).job().state(), v1::JOB_STATE_FINISHED) << get(id).job().detail();
      EXPECT_TRUE(cancel(id).ok());
    }
    EXPECT_TRUE(eventually_idle());
  }
};

TEST_F(ControlSteps, AreAnsweredBesideBlocks) { expect_answers_beside("1", {blocks()}); }
TEST_F(ControlSteps, AreAnsweredBesideBlocksOnAllWorkers) { expect_answers_beside("2", {blocks()}); }
TEST_F(ControlSteps, AreAnsweredBesideScenarios) { expect_answers_beside("1", {scenarios()}); }
TEST_F(ControlSteps, AreAnsweredBesideScenariosOnAllWorkers) { expect_answers_beside("2", {scenarios()}); }
TEST_F(ControlSteps, AreAnsweredBesideEverythingOnOneWorker) {
  expect_answers_beside("1", {global(), starts(), blocks(), scenarios()});
}
TEST_F(ControlSteps, AreAnsweredBesideEverythingOnTwoWorkers) {
  expect_answers_beside("2", {starts(), blocks(), scenarios(), global()});
}

}  // namespace
}  // namespace marble::testing
