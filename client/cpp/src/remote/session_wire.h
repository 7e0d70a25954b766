// The stream of a session, whose reads and writes may outlast the wait for them.
#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/completion_queue.h>
#include <grpcpp/support/async_stream.h>

#include <chrono>
#include <deque>
#include <memory>

#include "marble/v1/service.grpc.pb.h"
#include "mutex.h"

namespace marble::client {

/// Has no thread: the threads that wait drive it. One thread may write while another one reads.
class SessionWire {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Outcome { done, late, over };
  static constexpr Clock::time_point kForever = Clock::time_point::max();
  static constexpr std::size_t kMostUnsent = 16;

  /// Starts the call. Both must outlive the stream.
  SessionWire(v1::Solver::Stub& solver, grpc::ClientContext& context);
  /// Cancels the call unless it has finished.
  ~SessionWire();
  SessionWire(const SessionWire&) = delete;
  SessionWire& operator=(const SessionWire&) = delete;

  /// Sends a message after those before it, without waiting.
  void write(v1::SessionRequest request) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Waits while kMostUnsent messages or more have not left. Returns false if `end` comes first.
  [[nodiscard]] bool wait_room(Clock::time_point end) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Waits until all messages have left: the server may hold them back. Returns false once the stream is
  /// over.
  [[nodiscard]] bool wait_written() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Ends the sending, after all messages.
  void writes_done() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Waits for the next message, until `end`; after `late` the next call waits for the same message.
  [[nodiscard]] Outcome read(v1::SessionResponse* response, Clock::time_point end = kForever)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Waits for the status of a stream that is over or cancelled; called once.
  [[nodiscard]] grpc::Status finish() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Operation {
    bool pending = false, ok = true;
  };

  [[nodiscard]] bool wait(const Operation& operation, Clock::time_point end)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ended(Operation& operation, bool ok) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void start(Operation& operation) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { operation.pending = true; }

  grpc::ClientContext& context_;
  grpc::CompletionQueue queue_;
  Mutex mutex_;
  Condition changed_;
  bool polls_ ABSL_GUARDED_BY(mutex_) = false;  // one thread waits at the queue, for all
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  Operation write_ ABSL_GUARDED_BY(mutex_), read_ ABSL_GUARDED_BY(mutex_), finish_ ABSL_GUARDED_BY(mutex_);
  std::deque<v1::SessionRequest> outbox_ ABSL_GUARDED_BY(mutex_);
  bool reads_ ABSL_GUARDED_BY(mutex_) = false;  // a read was started, and its message was not taken
  v1::SessionResponse incoming_;
  std::unique_ptr<grpc::ClientAsyncReaderWriter<v1::SessionRequest, v1::SessionResponse>> stream_;
};

}  // namespace marble::client
