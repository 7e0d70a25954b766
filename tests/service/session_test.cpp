// Sessions: what an MPC loop relies on, over a real connection.
#include <algorithm>
#include <cmath>
#include <functional>
#include <thread>

#include "marble/solver.h"
#include "session_service_test.h"
#include "support/independent_check.h"

namespace marble::testing {
namespace {

TEST_F(Session, AnswersEveryUpdateWithItsSequenceNumber) {
  start();
  const auto call = set_up(setup_of(example_request()));
  for (const std::int64_t sequence : {1, 2, 7}) {
    v1::SessionRequest request = update(sequence);
    request.mutable_update()->mutable_problem()->add_equality_offset(-static_cast<double>(sequence));
    const auto answer = ask(*call, request);
    ASSERT_TRUE(answer && answer->has_answer()) << sequence;
    EXPECT_EQ(answer->answer().sequence(), sequence);
    EXPECT_EQ(answer->answer().solution().status(), v1::STATUS_SOLVED);
    EXPECT_NEAR(answer->answer().solution().z(0), static_cast<double>(sequence), 1e-9) << "z1 = -b";
  }
  call->done();
  EXPECT_FALSE(call->next().has_value());
  EXPECT_TRUE(call->finish().ok());
  EXPECT_TRUE(eventually_no_session());
  EXPECT_EQ(counters().updates_total(), 3);
}

TEST_F(Session, KeepsAPlannersLoopWarmForFiftyTicks) {
  start({"--workers", "1"});
  examples::HopperParameters parameters;
  const OwnedProblem first = examples::hopper(parameters);
  const auto call = set_up(setup_of(first));
  std::vector<int> warm, cold;
  for (int tick = 0; tick < 50; ++tick) {
    const OwnedProblem now = examples::hopper(parameters);
    v1::SessionRequest request = update(tick);
    to_message(ProblemUpdate{.c0 = now.c0, .g = now.g, .b = now.b, .d = now.d, .l = now.l, .r = now.r},
               request.mutable_update()->mutable_problem());
    v1::Shift* shift = request.mutable_update()->mutable_shift();
    const auto add = [&parameters](auto* blocks, std::size_t size) {
      auto* block = blocks->Add();
      block->set_count(static_cast<int>(size));
      block->set_by(static_cast<int>(size) / parameters.steps);
    };
    if (tick > 0) {
      add(shift->mutable_variables(), now.g.size());
      add(shift->mutable_equalities(), now.b.size());
      add(shift->mutable_inequalities(), now.d.size());
      add(shift->mutable_pairs(), now.l.size());
    }
    const auto answer = ask(*call, request);
    ASSERT_TRUE(answer && answer->has_answer());
    const Solution solution = solution_of(answer->answer().solution());
    ASSERT_EQ(solution.status, Status::solved) << "tick " << tick << ": " << solution.detail;
    const Verdict verdict = judge(now.view(), solution);
    EXPECT_LE(verdict.infeasibility(), 1e-6) << "tick " << tick;
    EXPECT_NEAR(verdict.objective, solution.objective, 1e-6 * std::abs(solution.objective));
    warm.push_back(solution.factorizations);
    if (tick % 10 == 0) cold.push_back(solve_in_process(now.view())->factorizations);
    parameters = examples::advance(parameters, solution.z);
  }
  std::sort(warm.begin(), warm.end());
  std::sort(cold.begin(), cold.end());
  EXPECT_LT(2 * warm[25], cold[2]) << "median factorizations";
}

TEST_F(Session, AWarmAnswerHasTheBitsOfTheSolverInProcess) {
  start();
  const OwnedProblem p = examples::rocket();
  const auto call = set_up(setup_of(p));
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  std::optional<Solution> last;
  for (int tick = 0; tick < 4; ++tick) {
    std::vector<double> g = p.g;
    for (double& value : g) value *= 1.0 + 1e-3 * tick;
    v1::SessionRequest request = update(tick);
    to_message(ProblemUpdate{.g = g}, request.mutable_update()->mutable_problem());
    const auto answer = ask(*call, request);
    ASSERT_TRUE(answer && answer->has_answer());
    ASSERT_TRUE(solver.update({.g = g}).has_value());
    last = solver.solve({.warm_start = last ? &*last : nullptr}).value();
    const auto& z = answer->answer().solution().z();
    ASSERT_EQ(std::vector<double>(z.begin(), z.end()), last->z) << "tick " << tick;
    EXPECT_EQ(answer->answer().solution().factorizations(), last->factorizations);
  }
}

TEST_F(Session, ColdForgetsAndOptionsStay) {
  start();
  const OwnedProblem p = examples::rocket();
  const auto call = set_up(setup_of(p));
  const int cold = ask(*call, update(1))->answer().solution().factorizations();
  EXPECT_LT(ask(*call, update(2))->answer().solution().factorizations(), cold);
  v1::SessionRequest reset = update(3);
  reset.mutable_update()->set_cold(true);
  EXPECT_EQ(ask(*call, reset)->answer().solution().factorizations(), cold);
  v1::SessionRequest limited = update(4);
  limited.mutable_update()->set_cold(true);
  limited.mutable_update()->mutable_options()->set_max_iterations(1);
  EXPECT_EQ(ask(*call, limited)->answer().solution().status(), v1::STATUS_ITERATION_LIMIT);
  const auto still = ask(*call, update(5));
  EXPECT_EQ(still->answer().solution().options().max_iterations(), 1) << "until they are changed again";
}

TEST_F(Session, MatrixValuesOfTheSamePatternCanChange) {
  start();
  const auto call = set_up(setup_of(example_request()));
  v1::SessionRequest request = update(1);
  request.mutable_update()->mutable_problem()->add_equality_values(2.0);  // 2 z1 = 1
  const auto answer = ask(*call, request);
  ASSERT_TRUE(answer && answer->has_answer());
  EXPECT_NEAR(answer->answer().solution().z(0), 0.5, 1e-9);
}

TEST_F(Session, ARefusedUpdateIsReportedWithFieldAndIndexAndChangesNothing) {
  start();
  const auto call = set_up(setup_of(example_request()));
  v1::SessionRequest bad = update(1);
  bad.mutable_update()->mutable_problem()->add_equality_offset(-5.0);
  for (int i = 0; i < 4; ++i)
    bad.mutable_update()->mutable_problem()->add_gradient(i == 2 ? std::nan("") : 0.0);
  const auto refused = ask(*call, bad);
  ASSERT_TRUE(refused && refused->has_error());
  EXPECT_EQ(refused->error().sequence(), 1);
  EXPECT_EQ(refused->error().status().code(), grpc::StatusCode::INVALID_ARGUMENT);
  const grpc::Status status(grpc::StatusCode::INVALID_ARGUMENT, "",
                            refused->error().status().SerializeAsString());
  EXPECT_EQ(bad_field(status).field(), "update.problem.gradient[2]");
  const auto answer = ask(*call, update(2));
  ASSERT_TRUE(answer && answer->has_answer());
  EXPECT_NEAR(answer->answer().solution().z(0), 1.0, 1e-9);
}

TEST_F(Session, NamesWhatIsWrongWithAnUpdate) {
  start();
  const auto call = set_up(setup_of(example_request()));
  ASSERT_TRUE(ask(*call, update(10))->has_answer());
  std::int64_t sequence = 11;
  const auto fault_of = [&](const std::function<void(v1::SessionUpdate&)>& spoil) {
    v1::SessionRequest request = update(sequence++);
    spoil(*request.mutable_update());
    const auto refused = ask(*call, request);
    if (!refused || !refused->has_error()) return std::string("not refused");
    return bad_field({grpc::StatusCode::UNKNOWN, "", refused->error().status().SerializeAsString()}).field();
  };
  EXPECT_EQ(fault_of([](auto& u) { u.set_sequence(10); }), "update.sequence");
  EXPECT_EQ(fault_of([](auto& u) { u.mutable_problem()->add_gradient(1.0); }), "update.problem.gradient");
  EXPECT_EQ(fault_of([](auto& u) { u.mutable_problem()->add_hessian_values(1.0); }),
            "update.problem.hessian_values");
  EXPECT_EQ(fault_of([](auto& u) {
              u.mutable_problem()->add_left_values(1.0);
              u.mutable_problem()->add_left_values(1.0);
            }),
            "update.problem.left_values");
  EXPECT_EQ(fault_of([](auto& u) { u.mutable_problem()->set_constant(INFINITY); }),
            "update.problem.constant");
  EXPECT_EQ(fault_of([](auto& u) { u.mutable_options()->set_kappa_min(-1.0); }), "update.options.kappa_min");
  EXPECT_EQ(fault_of([](auto& u) { u.mutable_initial_point()->add_z(1.0); }), "update.initial_point.z");
  EXPECT_EQ(fault_of([](auto& u) { u.set_deadline_s(-1.0); }), "update.deadline_s");
  EXPECT_EQ(fault_of([](auto& u) { u.mutable_shift()->add_variables()->set_count(5); }),
            "update.shift.variables[0].count");
  EXPECT_TRUE(ask(*call, update(sequence++))->has_answer()) << "and the session goes on";
}

TEST_F(Session, TheFirstMessageMustBeASetUpAndOnlyThat) {
  start();
  const auto early = open();
  early->write(update(1));
  EXPECT_EQ(early->finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  const auto twice = set_up(setup_of(example_request()));
  twice->write(setup_of(example_request()));
  EXPECT_EQ(twice->finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  const auto malformed = open();
  v1::SessionRequest bad = setup_of(example_request());
  bad.mutable_setup()->set_request_id("wrong-set-up");
  bad.mutable_setup()->mutable_problem()->set_gradient(1, INFINITY);
  malformed->write(bad);
  const grpc::Status status = malformed->finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(status).field(), "setup.problem.gradient[1]");
  EXPECT_TRUE(eventually([&] { return !server().log_lines({"refused", "wrong-set-up"}).empty(); }));
  EXPECT_TRUE(eventually_no_session());
}

TEST_F(Session, LatestOnlyDropsWhatWaitsAndKeepsItsNumbers) {
  start({"--workers", "1"});
  v1::SessionRequest setup = setup_of(example_request());
  setup.mutable_setup()->set_latest_only(true);
  const auto call = set_up(setup);
  Stream blocker(solver(), blocking_request());
  ASSERT_TRUE(blocker.read_until(Event::kStarted));
  v1::SessionRequest first = update(1);  // waits for the worker, in the queue
  ASSERT_TRUE(call->write(first));
  ASSERT_TRUE(eventually([&] { return counters().queued() == 1; }));
  v1::SessionRequest second = update(2);
  second.mutable_update()->mutable_problem()->add_equality_offset(-4.0);
  v1::SessionRequest third = update(3);
  third.mutable_update()->mutable_problem()->add_inequality_offset(-2.0);
  ASSERT_TRUE(call->write(second));
  ASSERT_TRUE(call->write(third));
  const auto superseded = call->next();
  ASSERT_TRUE(superseded && superseded->has_superseded());
  EXPECT_EQ(superseded->superseded().sequence(), 2);
  EXPECT_EQ(superseded->superseded().by_sequence(), 3);
  blocker.cancel();
  EXPECT_EQ(call->next()->answer().sequence(), 1);
  const auto answer = call->next();
  EXPECT_EQ(answer->answer().sequence(), 3);
  EXPECT_NEAR(answer->answer().solution().z(0), 4.0, 1e-9) << "of the second";
  EXPECT_NEAR(answer->answer().solution().z(1), 2.0, 1e-9) << "of the third";
}

TEST_F(Session, AFirstPartHasNoAnswerAndTheSecondIsOfBoth) {
  start();
  const auto call = set_up(setup_of(example_request()));
  ASSERT_TRUE(ask(*call, update(1))->has_answer());
  v1::SessionRequest first = update(2);
  first.mutable_update()->set_prepare(true);
  first.mutable_update()->mutable_problem()->add_equality_offset(-4.0);
  ASSERT_TRUE(call->write(first));
  v1::SessionRequest second = update(3);
  second.mutable_update()->mutable_problem()->add_inequality_offset(-2.0);
  const auto answer = ask(*call, second);
  ASSERT_TRUE(answer && answer->has_answer());
  EXPECT_EQ(answer->answer().sequence(), 3);
  EXPECT_NEAR(answer->answer().solution().z(0), 4.0, 1e-9) << "of the first";
  EXPECT_NEAR(answer->answer().solution().z(1), 2.0, 1e-9) << "of the second";
  EXPECT_EQ(counters().updates_total(), 2) << "a first part is no solve";
  EXPECT_EQ(counters().running(), 0);
}

TEST_F(Session, PartsThatStillWaitBecomeOne) {
  start({"--workers", "1"});
  const auto call = set_up(setup_of(example_request()));
  Stream blocker(solver(), blocking_request());
  ASSERT_TRUE(blocker.read_until(Event::kStarted));
  ASSERT_TRUE(call->write(update(1)));  // waits for the worker, in the queue
  ASSERT_TRUE(eventually([&] { return counters().queued() == 1; }));
  for (const std::int64_t number : {2, 3}) {
    v1::SessionRequest part = update(number);
    part.mutable_update()->set_prepare(true);
    part.mutable_update()->mutable_problem()->add_equality_offset(-2.0 * static_cast<double>(number));
    ASSERT_TRUE(call->write(part));
  }
  v1::SessionRequest whole = update(4);
  whole.mutable_update()->mutable_problem()->add_inequality_offset(-2.0);
  ASSERT_TRUE(call->write(whole));
  blocker.cancel();
  EXPECT_EQ(call->next()->answer().sequence(), 1);
  const auto answer = call->next();
  EXPECT_EQ(answer->answer().sequence(), 4);
  EXPECT_NEAR(answer->answer().solution().z(0), 6.0, 1e-9) << "of the newer first part";
  EXPECT_NEAR(answer->answer().solution().z(1), 2.0, 1e-9);
}

TEST_F(Session, WithLatestOnlyAFirstPartTakesThePlaceOfWhatWaits) {
  start({"--workers", "1"});
  v1::SessionRequest setup = setup_of(example_request());
  setup.mutable_setup()->set_latest_only(true);
  const auto call = set_up(setup);
  Stream blocker(solver(), blocking_request());
  ASSERT_TRUE(blocker.read_until(Event::kStarted));
  ASSERT_TRUE(call->write(update(1)));
  ASSERT_TRUE(eventually([&] { return counters().queued() == 1; }));
  v1::SessionRequest second = update(2);
  second.mutable_update()->mutable_problem()->add_equality_offset(-4.0);
  ASSERT_TRUE(call->write(second));
  v1::SessionRequest part = update(3);
  part.mutable_update()->set_prepare(true);
  ASSERT_TRUE(call->write(part));
  const auto superseded = call->next();
  ASSERT_TRUE(superseded && superseded->has_superseded());
  EXPECT_EQ(superseded->superseded().sequence(), 2);
  EXPECT_EQ(superseded->superseded().by_sequence(), 3);
  ASSERT_TRUE(call->write(update(4)));
  blocker.cancel();
  EXPECT_EQ(call->next()->answer().sequence(), 1);
  const auto answer = call->next();
  EXPECT_EQ(answer->answer().sequence(), 4);
  EXPECT_NEAR(answer->answer().solution().z(0), 4.0, 1e-9) << "of the second";
}

TEST_F(Session, AnInvalidFirstPartIsReportedAtOnceAndChangesNothing) {
  start();
  const auto call = set_up(setup_of(example_request()));
  const double before = ask(*call, update(1))->answer().solution().z(0);
  v1::SessionRequest part = update(2);
  part.mutable_update()->set_prepare(true);
  part.mutable_update()->mutable_problem()->add_equality_offset(std::nan(""));
  const auto refused = ask(*call, part);
  ASSERT_TRUE(refused && refused->has_error());
  EXPECT_EQ(refused->error().sequence(), 2);
  EXPECT_EQ(refused->error().status().code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(ask(*call, update(3))->answer().solution().z(0), before);
}

TEST_F(Session, ReportsProgressOfEachUpdateBeforeItsAnswer) {
  start();
  v1::SessionRequest setup = setup_of(examples::rocket());
  setup.mutable_setup()->set_progress(true);
  const auto call = set_up(setup);
  for (const std::int64_t sequence : {1, 2}) {
    ASSERT_TRUE(call->write(update(sequence)));
    int rows = 0;
    std::int64_t skipped = 0;
    auto event = call->next();
    for (; event && event->has_progress(); event = call->next()) {
      EXPECT_EQ(event->progress().sequence(), sequence);
      rows += event->progress().progress().rows_size();
      skipped = event->progress().progress().skipped();
    }
    ASSERT_TRUE(event && event->has_answer());
    EXPECT_GE(rows + skipped, event->answer().solution().iterations()) << "update " << sequence;
  }
}

TEST_F(Session, HoldsNoWorkerBetweenUpdates) {
  start({"--workers", "1"});
  std::vector<std::unique_ptr<Call>> sessions;
  for (int i = 0; i < 20; ++i) sessions.push_back(set_up(setup_of(example_request())));
  v1::SolveResponse response;
  EXPECT_TRUE(solve(example_request(), &response).ok());
  for (const auto& session : sessions) EXPECT_TRUE(ask(*session, update(1))->has_answer());
  EXPECT_EQ(counters().sessions(), 20);
  EXPECT_GT(counters().session_bytes(), 0);
  sessions.clear();
  EXPECT_TRUE(eventually_no_session());
  EXPECT_EQ(counters().session_bytes(), 0);
}

TEST_F(Session, ADroppedStreamFreesWorkerAndMemoryAtOnce) {
  start({"--workers", "1"});
  auto call = set_up(setup_of(long_request()));
  call->write(update(1));
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  call->write(update(2));
  call->cancel();
  EXPECT_TRUE(eventually_idle());
  EXPECT_TRUE(eventually_no_session());
  EXPECT_EQ(counters().session_bytes(), 0);
}

TEST_F(Session, AnIdleOneIsEnded) {
  start({"--session-idle-s", "1"});
  const auto call = open();
  call->write(setup_of(example_request()));
  // Ready comes first; nothing does where a machine is so busy that the second is over before.
  while (call->next()) {
  }
  EXPECT_EQ(call->finish().error_code(), grpc::StatusCode::ABORTED);
  EXPECT_TRUE(eventually_no_session());
}

TEST_F(Session, NumberAndMemoryAreLimited) {
  start({"--sessions", "2", "--client-sessions", "0", "--session-bytes", "3000000"});
  const auto first = set_up(setup_of(example_request()));
  {
    const auto second = set_up(setup_of(example_request()));
    const auto third = open();
    const grpc::Status refused = third->finish();
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_NE(refused.error_message().find("sessions"), std::string::npos) << refused.error_message();
  }
  ASSERT_TRUE(eventually([&] { return counters().sessions() == 1; }));
  const auto large = open();
  large->write(setup_of(examples::rocket()));
  const grpc::Status refused = large->finish();
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(ask(*first, update(1))->has_answer()) << "no other session is disturbed";
}

TEST_F(Session, ManyThatAreRefusedAndGoAwayAtOnceDisturbNobody) {
  start({"--sessions", "0"});
  for (int i = 0; i < 300; ++i) {
    const auto refused = open();
    if (i % 2 == 0) refused->write(setup_of(example_request()));
    refused->cancel();
  }
  EXPECT_TRUE(lives());
}

TEST_F(Session, SlowsAClientThatSendsFasterThanItSolvesAndLosesNothing) {
  start({"--workers", "1", "--session-updates", "4"});
  const auto call = set_up(setup_of(example_request()));
  constexpr int kFastUpdates = 3000;
  std::thread writer([&] {
    for (int i = 1; i <= kFastUpdates; ++i) ASSERT_TRUE(call->write(update(i)));
    call->done();
  });
  for (int i = 1; i <= kFastUpdates; ++i) {
    const auto answer = call->next();
    ASSERT_TRUE(answer && answer->has_answer()) << i;
    ASSERT_EQ(answer->answer().sequence(), i);
  }
  writer.join();
  EXPECT_TRUE(call->finish().ok());
}

TEST_F(Session, ADrainAnswersWhatItHasAndEndsTheStream) {
  start({"--workers", "1", "--drain-grace-s", "0.1"});
  const auto idle = set_up(setup_of(example_request()));
  const auto busy = set_up(setup_of(long_request()));
  busy->write(update(1));
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  server().terminate();
  EXPECT_EQ(idle->finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  const auto answer = busy->next();
  EXPECT_TRUE(answer && answer->has_answer());
  EXPECT_EQ(busy->finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(server().wait(), 0);
}

}  // namespace
}  // namespace marble::testing
