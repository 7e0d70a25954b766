// Sends requests that share a stream: updates of a session, problems of a batch.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <utility>

#include "load_target.h"
#include "mutex.h"
#include "work.h"
#include "workload.h"

namespace marble::load {

class StreamLane : public Lane, private grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  /// All arguments outlive the lane. `client` selects the connection.
  StreamLane(const Target& target, const LoadedEntry& entry, std::size_t client, const Done& done);
  /// Cancels what has no result.
  ~StreamLane() override;

  /// Opens the stream, and waits for a session to be ready. Called once, before anything is sent.
  [[nodiscard]] Expected<void> open();
  void send(const Work& work) override;
  void cancel() override;

 private:
  void OnReadDone(bool good) override;
  void OnWriteDone(bool good) override;
  void OnDone(const grpc::Status& status) override;

  struct Outcome {
    std::int64_t id = 0;
    Reply reply;
  };
  [[nodiscard]] grpc::ByteBuffer message(std::int64_t id, const Work& work) const;
  [[nodiscard]] Outcome outcome_of(grpc::ByteBuffer& bytes, bool& ready) const;
  void write_next() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void end_writing();

  const Target& target_;
  const LoadedEntry& entry_;
  const std::size_t client_;
  const Done& done_;
  grpc::ClientContext context_;
  grpc::ByteBuffer read_;
  bool opened_ = false;

  Mutex mutex_;
  Condition changed_;
  grpc::ByteBuffer written_ ABSL_GUARDED_BY(mutex_);
  bool ready_ ABSL_GUARDED_BY(mutex_) = false, writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;  // no more writes: the hold for other writers is gone
  bool over_ ABSL_GUARDED_BY(mutex_) = false;
  grpc::Status status_ ABSL_GUARDED_BY(mutex_);
  std::int64_t last_id_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::int64_t, Work> waiting_ ABSL_GUARDED_BY(mutex_);
  std::deque<grpc::ByteBuffer> unwritten_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::load
