// Requests that share a stream: updates of a session, problems of a batch.
#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "load_target.h"
#include "work.h"
#include "workload.h"

namespace marble::load {

class StreamLane : public Lane, private grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  /// All outlive the lane. `client` chooses the connection.
  StreamLane(const Target& target, const LoadedEntry& entry, std::size_t client, const Done& done);
  /// Gives up what is not answered.
  ~StreamLane() override;

  /// Opens the stream, and waits for a session to be ready. Once, before anything is sent.
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
  void write_next();  // with mutex_ held
  void end_writing();

  const Target& target_;
  const LoadedEntry& entry_;
  const std::size_t client_;
  const Done& done_;
  grpc::ClientContext context_;
  grpc::ByteBuffer read_, written_;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool opened_ = false, ready_ = false, writing_ = false;
  bool broken_ = false;  // no more writes: the hold that let others write is gone
  bool over_ = false;
  grpc::Status status_;
  std::int64_t last_id_ = 0;
  std::map<std::int64_t, Work> waiting_;
  std::deque<grpc::ByteBuffer> unwritten_;
};

}  // namespace marble::load
