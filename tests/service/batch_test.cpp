// SolveBatch: many problems on one stream.
#include <algorithm>
#include <map>
#include <thread>

#include "bidi.h"
#include "service_test.h"

namespace marble::testing {
namespace {

using BatchCall = Bidi<v1::SolveBatchRequest, v1::SolveBatchResponse>;

class Batch : public ServiceTest {
 protected:
  std::unique_ptr<BatchCall> open() {
    return std::make_unique<BatchCall>(
        [this](grpc::ClientContext* context) { return solver().SolveBatch(context); });
  }
  static v1::SolveBatchRequest problem(std::int64_t tag, const v1::SolveRequest& solve) {
    v1::SolveBatchRequest request;
    request.set_tag(tag);
    *request.mutable_solve() = solve;
    return request;
  }
  /// The example with z1 = tag.
  static v1::SolveBatchRequest tagged(std::int64_t tag) {
    v1::SolveBatchRequest request = problem(tag, example_request());
    request.mutable_solve()->mutable_problem()->set_equality_offset(0, -static_cast<double>(tag));
    return request;
  }
};

TEST_F(Batch, TenThousandProblemsAreAllAnsweredOnceThroughASmallQueue) {
  start({"--workers", "2", "--queue-jobs", "4", "--batch-window", "16"});
  const auto call = open();
  constexpr int kProblems = 10'000;
  std::thread writer([&] {
    for (int tag = 0; tag < kProblems; ++tag) ASSERT_TRUE(call->write(tagged(tag)));
    call->done();
  });
  std::map<std::int64_t, int> answers;
  for (const v1::SolveBatchResponse& response : call->drain()) {
    ++answers[response.tag()];
    ASSERT_TRUE(response.has_result()) << response.error().message();
    ASSERT_NEAR(response.result().solution().z(0), static_cast<double>(response.tag()), 1e-6);
  }
  writer.join();
  EXPECT_TRUE(call->finish().ok());
  EXPECT_EQ(answers.size(), static_cast<std::size_t>(kProblems));
  EXPECT_TRUE(
      std::all_of(answers.begin(), answers.end(), [](const auto& entry) { return entry.second == 1; }));
  EXPECT_EQ(counters().refused_total(), 0) << "slowed, not refused";
}

TEST_F(Batch, AClientThatDoesNotReadHoldsNoMoreThanItsWindow) {
  start({"--workers", "1", "--batch-window", "3"});
  const auto call = open();
  std::thread writer([&] {
    for (int tag = 0; tag < 200; ++tag) {
      if (!call->write(tagged(tag))) return;
    }
    call->done();
  });
  // Answers wait in HTTP/2's windows too; what is accepted stops growing.
  std::int64_t before = -1;
  EXPECT_TRUE(eventually([&] {
    const std::int64_t now = counters().accepted_total();
    const bool same = now == before && now > 0;
    before = now;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    return same;
  }));
  EXPECT_EQ(call->drain().size(), 200U);
  writer.join();
  EXPECT_TRUE(call->finish().ok());
}

TEST_F(Batch, AnswersAsTheyFinish) {
  start({"--workers", "2"});
  const auto call = open();
  call->write(problem(1, long_request()));
  call->write(tagged(2));
  const auto first = call->next();
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->tag(), 2);
}

TEST_F(Batch, ABadProblemIsAnErrorOfItsOwnAndTheStreamGoesOn) {
  start();
  const auto call = open();
  v1::SolveBatchRequest bad = tagged(1);
  bad.mutable_solve()->mutable_problem()->mutable_equality_matrix()->set_row_indices(0, 7);
  call->write(bad);
  call->write(problem(2, {}));
  call->write(tagged(3));
  call->done();
  std::map<std::int64_t, v1::SolveBatchResponse> answers;
  for (const auto& response : call->drain()) answers[response.tag()] = response;
  ASSERT_EQ(answers.size(), 3U);
  const grpc::Status status(grpc::StatusCode::UNKNOWN, "", answers[1].error().SerializeAsString());
  EXPECT_EQ(bad_field(status).field(), "solve.problem.equality_matrix.row_indices[0]");
  EXPECT_TRUE(answers[2].has_error());
  EXPECT_TRUE(answers[3].has_result());
  EXPECT_TRUE(call->finish().ok());
}

TEST_F(Batch, ADroppedStreamFreesEverythingAtOnce) {
  start({"--workers", "1", "--queue-jobs", "2", "--client-queued", "0"});
  const auto call = open();
  for (int tag = 0; tag < 6; ++tag) call->write(problem(tag, long_request()));
  ASSERT_TRUE(eventually([&] { return counters().running() == 1 && counters().queued() == 2; }));
  call->cancel();
  EXPECT_TRUE(eventually_idle());
  EXPECT_EQ(counters().queued(), 0);
  EXPECT_TRUE(lives());
}

TEST_F(Batch, ADrainAnswersWhatItTookAndSaysThatTheRestIsForOthers) {
  start({"--workers", "1", "--drain-grace-s", "0.1"});
  const auto call = open();
  call->write(problem(1, long_request()));
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  server().terminate();
  const auto answer = call->next();
  ASSERT_TRUE(answer.has_value());
  EXPECT_TRUE(answer->has_result());
  EXPECT_EQ(call->finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(server().wait(), 0);
}

}  // namespace
}  // namespace marble::testing
