// What an answer of the HTTP port takes is held until it is sent.
#include <gmock/gmock.h>

#include "http/reply.h"
#include "marble/v1/service.pb.h"
#include "message_json.h"

namespace marble::server::http {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kBytes = 1 << 20;

std::shared_ptr<v1::SolveResponse> answer_of(int numbers) {
  auto message = std::make_shared<v1::SolveResponse>();
  for (int i = 0; i < numbers; ++i) message->mutable_solution()->add_z(1.0 / (i + 1));
  return message;
}

TEST(Semaphore, AreGivenBackAndNeverMoreThanThereAre) {
  Semaphore semaphore(1, 100);
  {
    const auto first = semaphore.stay();
    ASSERT_TRUE(first);
    const auto second = semaphore.stay();
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, ErrorCode::resource_exhausted);
    EXPECT_TRUE(semaphore.hold("alice", 50)) << "memory is counted by itself";
  }
  EXPECT_TRUE(semaphore.stay());
}

TEST(Semaphore, MemoryIsSharedAndOneRequestAloneMayHaveMore) {
  Semaphore semaphore(1, 100);
  {
    const auto some = semaphore.hold("alice", 60);
    ASSERT_TRUE(some);
    EXPECT_TRUE(semaphore.hold("bob", 40));
    EXPECT_FALSE(semaphore.hold("bob", 41));
    EXPECT_FALSE(semaphore.hold("bob", 1000));
  }
  const auto alone = semaphore.hold("alice", 1000);
  ASSERT_TRUE(alone);
  EXPECT_FALSE(semaphore.hold("bob", 1));
}

TEST(Semaphore, OneClientTakesHalfOfTheMemoryAtMost) {
  Semaphore semaphore(1, 100);
  const auto first = semaphore.hold("alice", 30);
  ASSERT_TRUE(first);
  const auto second = semaphore.hold("alice", 30);
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().bound, HasSubstr("this client"));
  EXPECT_TRUE(semaphore.hold("alice", 20));
  EXPECT_TRUE(semaphore.hold("bob", 50));
}

TEST(Semaphore, ResizeToWhatARequestReallyTakes) {
  Semaphore semaphore(1, 100);
  auto one = semaphore.hold("alice", 100);
  ASSERT_TRUE(one);
  EXPECT_FALSE(semaphore.hold("bob", 1));
  ASSERT_TRUE(one->resize(20));
  auto other = semaphore.hold("bob", 80);
  ASSERT_TRUE(other);
  EXPECT_FALSE(one->resize(21));
  EXPECT_TRUE(other->resize(79));
  EXPECT_TRUE(one->resize(21)) << "a refusal left it as it was";
}

TEST(LongAnswer, HoldsItsMemoryAndAThreadUntilTheResponseIsGone) {
  Semaphore semaphore(1, kBytes);
  {
    httplib::Response response;
    const auto message = answer_of(50'000);
    auto memory = semaphore.hold("alice", kBytes);
    ASSERT_TRUE(memory);
    ASSERT_TRUE(reply_long_json(response, semaphore, *std::move(memory), message));
    EXPECT_TRUE(response.body.empty()) << "no text is made before it is sent";
    EXPECT_EQ(response.content_length_, message_json_size(*message));
    EXPECT_FALSE(semaphore.stay());
    const auto held = static_cast<std::int64_t>(message->SpaceUsedLong()) + kJsonPieceBytes;
    EXPECT_FALSE(semaphore.hold("bob", kBytes - held + 1));
    EXPECT_TRUE(semaphore.hold("bob", kBytes - held))
        << "it has the size that it takes, not what was asked for first";
    httplib::DataSink sink;
    std::string sent;
    sink.write = [&](const char* bytes, std::size_t size) {
      sent.append(bytes, size);
      return true;
    };
    EXPECT_TRUE(response.content_provider_(0, response.content_length_, sink));
    EXPECT_EQ(sent, to_json(*message));
    EXPECT_FALSE(semaphore.stay()) << "the last bytes are perhaps on their way";
  }
  EXPECT_TRUE(semaphore.stay());
  EXPECT_TRUE(semaphore.hold("bob", kBytes));
}

TEST(LongAnswer, OfAFewBytesHoldsNothing) {
  Semaphore semaphore(0, kBytes);
  httplib::Response response;
  const auto message = answer_of(10);
  ASSERT_TRUE(reply_long_json(response, semaphore, "alice", message));
  EXPECT_EQ(response.body, to_json(*message));
  EXPECT_TRUE(semaphore.hold("alice", kBytes));
}

TEST(LongAnswer, IsRefusedWhereNoMemoryOrThreadIsLeft) {
  const auto message = answer_of(50'000);
  httplib::Response response;
  Semaphore without_threads(0, kBytes);
  EXPECT_EQ(reply_long_json(response, without_threads, "alice", message).error().field, "http_connections");
  Semaphore without_memory(1, kBytes);
  const auto other = without_memory.hold("bob", kBytes);
  EXPECT_EQ(reply_long_json(response, without_memory, "alice", message).error().field, "transport_bytes");
}

}  // namespace
}  // namespace marble::server::http
