#include "jobs/result_store.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

using std::chrono::seconds;

ResultStore::Result text(std::size_t bytes) {
  const grpc::Slice slice(std::string(bytes, 'x'));
  return {grpc::ByteBuffer(&slice, 1), 0.0};
}

void expect(ResultStore& store, const std::string& id, const std::string& client) {
  EXPECT_EQ(store.expect(id, client).value(), id);
}

const Clock::time_point kStart = Clock::time_point() + seconds(1000);

TEST(ResultStore, KeepsWhatIsExpectedAndNothingElse) {
  ResultStore store({seconds(10), 10'000});
  EXPECT_FALSE(store.put("unauthenticated", text(1), kStart));
  expect(store, "job", "client");
  EXPECT_EQ(store.owner("job"), "client");
  EXPECT_EQ(store.get("job"), nullptr);
  EXPECT_TRUE(store.put("job", text(5), kStart));
  ASSERT_NE(store.get("job"), nullptr);
  EXPECT_EQ(store.get("job")->answer->Length(), 5U);
  EXPECT_TRUE(store.forget("job"));
  EXPECT_FALSE(store.forget("job"));
  EXPECT_EQ(store.bytes(), 0);
  EXPECT_EQ(store.owner("job"), "");
}

TEST(ResultStore, LetsGoOfTheOldestBeyondItsBytes) {
  ResultStore store({seconds(10), 4000});
  for (const char* id : {"a", "b", "c", "d"}) {
    expect(store, id, "client");
    store.put(id, text(1000), kStart);
    EXPECT_LE(store.bytes(), 4000);
  }
  EXPECT_EQ(store.get("a"), nullptr);
  EXPECT_EQ(store.get("b"), nullptr);
  EXPECT_NE(store.get("c"), nullptr);
  EXPECT_NE(store.get("d"), nullptr);
}

TEST(ResultStore, AnAnswerLargerThanEverythingIsAnErrorInWords) {
  ResultStore store({seconds(10), 4000});
  expect(store, "job", "client");
  EXPECT_FALSE(store.put("job", text(5000), kStart));
  ASSERT_NE(store.get("job"), nullptr);
  EXPECT_EQ(store.get("job")->answer.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(store.get("job")->answer.error().field, "result_bytes");
}

TEST(ResultStore, RequestsHaveTheRoomThatAnswersLeaveAndGoBeforeAnyOfThese) {
  std::vector<std::string> gone, without_request;
  ResultStore store(
      {seconds(10), 6000}, [&](const std::string& id) { gone.push_back(id); },
      [&](const std::string& id) { without_request.push_back(id); });
  const auto request = std::make_shared<const v1::SolveRequest>();
  const auto finish = [&](const std::string& id, std::int64_t request_bytes, std::size_t answer_bytes) {
    expect(store, id, "client");
    store.keep_request(id, {request, request_bytes});
    EXPECT_EQ(store.request(id)->message, request) << "while it runs, too";
    EXPECT_TRUE(store.put(id, text(answer_bytes), kStart));
  };
  finish("a", 2000, 1000);
  finish("b", 1000, 0);
  EXPECT_TRUE(store.request("a") && store.request("b"));
  finish("c", 1000, 1000);
  EXPECT_FALSE(store.request("a")) << "7024 bytes were too many";
  EXPECT_TRUE(store.request("b") && store.request("c"));
  finish("d", 100'000, 10);
  EXPECT_FALSE(store.request("b") || store.request("c") || store.request("d"));
  EXPECT_EQ(without_request, (std::vector<std::string>{"a", "b", "c", "d"}));
  EXPECT_TRUE(gone.empty()) << "no answer made room for a request";
  for (const char* id : {"a", "b", "c", "d"}) EXPECT_NE(store.get(id), nullptr) << id;
}

TEST(ResultStore, ARequestGoesWithItsAnswer) {
  ResultStore store({seconds(10), 10'000});
  for (const char* id : {"deleted", "old"}) {
    expect(store, id, "client");
    store.keep_request(id, {std::make_shared<const v1::SolveRequest>(), 4000});
    store.put(id, text(1), kStart);
  }
  EXPECT_TRUE(store.forget("deleted"));
  EXPECT_FALSE(store.request("deleted"));
  store.expire(kStart + seconds(10));
  EXPECT_FALSE(store.request("old"));
  expect(store, "new", "client");
  store.keep_request("new", {std::make_shared<const v1::SolveRequest>(), 9000});
  store.put("new", text(1), kStart);
  EXPECT_TRUE(store.request("new")) << "the bytes of the others are free again";
}

TEST(ResultStore, LetsGoOfWhatIsTooOld) {
  ResultStore store({seconds(10), 10'000});
  expect(store, "old", "client");
  store.put("old", text(1), kStart);
  expect(store, "new", "client");
  store.put("new", text(1), kStart + seconds(5));
  store.expire(kStart + seconds(9));
  EXPECT_NE(store.get("old"), nullptr);
  store.expire(kStart + seconds(10));
  EXPECT_EQ(store.get("old"), nullptr);
  EXPECT_NE(store.get("new"), nullptr);
}

TEST(ResultStore, CallsBackOnceWhoeverWaits) {
  ResultStore store({seconds(10), 10'000});
  expect(store, "job", "client");
  int first = 0, second = 0, nothing = 0;
  store.wait("job", &first, [&](const ResultStore::Shared& result) { first += result != nullptr ? 1 : 100; });
  store.wait("job", &second, [&](const ResultStore::Shared&) { ++second; });
  store.stop_waiting("job", &second);
  EXPECT_EQ(first, 0);
  store.put("job", text(1), kStart);
  EXPECT_EQ(first, 1);
  EXPECT_EQ(second, 0) << "it did not wait any more";
  store.wait("job", &first, [&](const ResultStore::Shared& result) { first += result != nullptr ? 1 : 100; });
  EXPECT_EQ(first, 2) << "at once where it is there";
  store.wait("gone", &nothing,
             [&](const ResultStore::Shared& result) { nothing += result == nullptr ? 1 : 100; });
  EXPECT_EQ(nothing, 1);
}

TEST(ResultStore, WhoeverWaitsForWhatIsLetGoIsReported) {
  ResultStore store({seconds(10), 10'000});
  expect(store, "job", "client");
  int reported = 0;
  store.wait("job", &reported,
             [&](const ResultStore::Shared& result) { reported += result == nullptr ? 1 : 100; });
  EXPECT_TRUE(store.forget("job"));
  EXPECT_EQ(reported, 1);
}

// What makes a submission that is sent again the same job.
TEST(ResultStore, ARequestIdIsOneJobUntilItIsLetGo) {
  ResultStore store({seconds(10), 10'000});
  EXPECT_EQ(store.expect("first", "client", {"mine", "digest"}).value(), "first");
  EXPECT_EQ(store.expect("second", "client", {"mine", "digest"}).value(), "first");
  EXPECT_EQ(store.expect("third", "other", {"mine", "digest"}).value(), "third");
  EXPECT_EQ(store.owner("second"), "");
  const auto taken = store.expect("fourth", "client", {"mine", "another"});
  ASSERT_FALSE(taken.has_value());
  EXPECT_EQ(taken.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(taken.error().field, "request_id");
  EXPECT_TRUE(store.forget("first"));
  EXPECT_EQ(store.expect("fifth", "client", {"mine", "another"}).value(), "fifth");
}

TEST(ResultStore, AnArrayThatAnotherServerContinuesTakesNothing) {
  ResultStore store({seconds(10), 4000});
  store.set_fetch([](const std::string&) {});
  for (const char* id : {"left", "ended"}) {
    expect(store, id, "client");
    EXPECT_TRUE(store.grow(id, 1000));
  }
  EXPECT_FALSE(store.grow("left", 1)) << "arrays that have not ended have half";
  store.stop_growing("left");
  store.kept_elsewhere("ended");
  EXPECT_EQ(store.bytes(), 0);
  EXPECT_TRUE(store.grow("left", 2000));
  store.stop_growing("unknown");
}

TEST(ResultStore, ReportsOfEachThatIsLetGo) {
  std::vector<std::string> gone;
  ResultStore store({seconds(10), 4000}, [&](const std::string& id) { gone.push_back(id); });
  for (const char* id : {"a", "b", "c", "d"}) {
    expect(store, id, "client");
    store.put(id, text(1000), kStart);
  }
  EXPECT_EQ(gone, (std::vector<std::string>{"a", "b"}));
  store.forget("c");
  store.expire(kStart + seconds(11));
  EXPECT_EQ(gone, (std::vector<std::string>{"a", "b", "c", "d"}));
}

}  // namespace
}  // namespace marble::server
