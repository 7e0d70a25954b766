// The handshake of a call with its stream, on a stream that does what a test says.
#include "service/stream_pump.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <string>
#include <vector>

namespace marble::server {
namespace {

grpc::ByteBuffer bytes_of(const std::string& text) {
  const grpc::Slice slice(text);
  return {&slice, 1};
}

std::string text_of(const grpc::ByteBuffer& bytes) {
  std::vector<grpc::Slice> slices;
  if (!bytes.Dump(&slices).ok()) return "";
  std::string text;
  for (const grpc::Slice& slice : slices)
    text.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return text;
}

// In gRPC's place: notes what it is asked for.
class FakeReactor {
 public:
  virtual ~FakeReactor() = default;
  virtual void OnReadDone(bool ok) = 0;
  virtual void OnWriteDone(bool ok) = 0;
  virtual void OnCancel() = 0;
  virtual void OnDone() = 0;

  void StartRead(grpc::ByteBuffer* into) {
    asked.push_back("read");
    read_into = into;
    if (on_read) on_read();
    asked.push_back("asked to read");
  }
  void StartWrite(const grpc::ByteBuffer* bytes) {
    asked.push_back("write " + text_of(*bytes));
    if (on_write) on_write();
  }
  void Finish(const grpc::Status& status) {
    asked.push_back("finish " + std::to_string(status.error_code()));
  }

  std::vector<std::string> asked;
  grpc::ByteBuffer* read_into = nullptr;
  std::function<void()> on_read, on_write;
};

// Answers with what a test gives it, and ends when the client has and nothing is left.
class TestCall final : public StreamPump<TestCall, FakeReactor, grpc::ByteBuffer> {
 public:
  static std::shared_ptr<TestCall> begin(int room) {
    auto call = std::make_shared<TestCall>();
    call->self_ = call;
    const MutexLock lock(call->mutex_);
    call->room_ = room;
    return call;
  }
  using StreamPump::end_at_once;
  using StreamPump::go_on;

  void OnReadDone(bool ok) override { read_done(ok); }
  void message(const std::string& text) {
    *read_into = bytes_of(text);
    OnReadDone(true);
  }
  void answer(const std::string& text) {
    {
      const MutexLock lock(mutex_);
      answers_.push_back(bytes_of(text));
    }
    go_on();
  }
  void make_room(int room) {
    {
      const MutexLock lock(mutex_);
      room_ = room;
    }
    go_on();
  }
  [[nodiscard]] int count(const std::string& what) const {
    return static_cast<int>(std::count(asked.begin(), asked.end(), what));
  }
  [[nodiscard]] bool has_finished() const { return asked.back().starts_with("finish"); }

  std::vector<std::string> messages;
  bool is_gone = false;

 private:
  [[nodiscard]] bool may_read() const override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return room_ > 0; }
  [[nodiscard]] bool next_event(grpc::ByteBuffer* event) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (answers_.empty()) return false;
    event->Swap(&answers_.front());
    answers_.pop_front();
    return true;
  }
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (!read_all() && !broken()) return std::nullopt;
    return grpc::Status::OK;
  }
  void received(grpc::ByteBuffer* message) override ABSL_LOCKS_EXCLUDED(mutex_) {
    if (message == nullptr) return;
    messages.push_back(text_of(*message));
    const MutexLock lock(mutex_);
    --room_;
  }
  void gone() override { is_gone = true; }

  int room_ ABSL_GUARDED_BY(mutex_) = 0;
  std::deque<grpc::ByteBuffer> answers_ ABSL_GUARDED_BY(mutex_);
};

TEST(StreamPump, ReadsOneMessageAtATimeWhileThereIsRoom) {
  const auto call = TestCall::begin(2);
  call->go_on();
  call->go_on();
  EXPECT_EQ(call->count("read"), 1) << "one is in flight";
  call->message("a");
  EXPECT_EQ(call->count("read"), 2);
  call->message("b");
  EXPECT_EQ(call->count("read"), 2) << "there is no room";
  call->make_room(1);
  EXPECT_EQ(call->count("read"), 3);
  EXPECT_EQ(call->messages, (std::vector<std::string>{"a", "b"}));
  call->OnDone();
}

TEST(StreamPump, WritesInOrderAndOneAtATime) {
  const auto call = TestCall::begin(0);
  call->answer("a");
  call->answer("b");
  EXPECT_EQ(call->asked, std::vector<std::string>{"write a"});
  call->OnWriteDone(true);
  EXPECT_EQ(call->asked, (std::vector<std::string>{"write a", "write b"}));
  call->OnDone();
}

TEST(StreamPump, EndsWhenTheLastAnswerIsWritten) {
  const auto call = TestCall::begin(1);
  call->go_on();
  call->answer("a");
  call->answer("b");
  call->OnReadDone(false);
  EXPECT_FALSE(call->has_finished());
  call->OnWriteDone(true);
  EXPECT_FALSE(call->has_finished()) << "b is on its way";
  call->OnWriteDone(true);
  EXPECT_EQ(call->asked.back(), "finish 0");
  call->go_on();
  call->OnCancel();
  EXPECT_EQ(call->count("finish 0"), 1);
  call->OnDone();
}

// gRPC may be done with a call that has ended, and asking for a read would use memory it has freed.
TEST(StreamPump, DoesNotEndWhileItAsksForARead) {
  const auto call = TestCall::begin(1);
  call->on_read = [&] { call->OnCancel(); };
  call->go_on();
  EXPECT_EQ(call->asked, (std::vector<std::string>{"read", "asked to read", "finish 0"}));
  call->OnDone();
}

TEST(StreamPump, WhatHappensWithinGrpcOnTheSameThreadIsTaken) {
  const auto call = TestCall::begin(0);
  call->on_write = [&] { call->OnWriteDone(true); };
  call->answer("a");
  call->answer("b");
  EXPECT_EQ(call->asked, (std::vector<std::string>{"write a", "write b"}));
  call->OnDone();
}

TEST(StreamPump, WritesNothingMoreOnceTheClientIsGone) {
  for (const bool by_write : {false, true}) {
    const auto call = TestCall::begin(0);
    call->answer("a");
    call->answer("b");
    by_write ? call->OnWriteDone(false) : call->OnCancel();
    EXPECT_EQ(call->is_gone, !by_write);
    if (!by_write) {
      EXPECT_FALSE(call->has_finished()) << "a write is in flight";
      call->OnWriteDone(false);
    }
    EXPECT_EQ(call->asked, (std::vector<std::string>{"write a", "finish 0"}));
    call->OnDone();
  }
}

TEST(StreamPump, ACallThatIsRefusedEndsOnce) {
  const auto call = TestCall::begin(1);
  call->end_at_once({grpc::StatusCode::UNAUTHENTICATED, "who are you?"});
  call->OnCancel();
  call->make_room(1);
  EXPECT_EQ(call->asked, std::vector<std::string>{"finish 16"});
  call->OnDone();
}

TEST(StreamPump, LivesUntilGrpcIsDoneWithIt) {
  std::weak_ptr<TestCall> call = TestCall::begin(0);
  ASSERT_FALSE(call.expired());
  call.lock()->OnDone();
  EXPECT_TRUE(call.expired());
}

}  // namespace
}  // namespace marble::server
