// Many independent problems on one stream: reads while there is capacity, and sends results as they finish.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <deque>
#include <optional>
#include <unordered_map>

#include "service/admission.h"
#include "service/service_parts.h"
#include "service/stream_pump.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; its jobs own it too, until they have finished. The number of
/// problems that wait, run or have unsent results is bounded: beyond it the call does not read, and HTTP/2
/// slows the client.
class BatchCall final
    : public StreamPump<BatchCall, grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
                        grpc::ByteBuffer>,
      public RoomWaiter,
      public TimerListener {
 public:
  static grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* begin(
      const ServiceParts& parts, grpc::CallbackServerContext& context);

  void OnReadDone(bool ok) override { read_done(ok); }
  // From the scheduler.
  void room() override ABSL_LOCKS_EXCLUDED(mutex_);
  // From the timer: drain.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  class Item;
  explicit BatchCall(const ServiceParts& parts) : token_(parts.calls), parts_(parts) {}

  void take(const std::shared_ptr<Job>& job, std::int64_t tag) ABSL_LOCKS_EXCLUDED(mutex_);
  void admit(const std::shared_ptr<Job>& job, std::int64_t tag) ABSL_LOCKS_EXCLUDED(mutex_);
  void answer(std::int64_t tag, const JobRecord& record, const Outcome& outcome) ABSL_LOCKS_EXCLUDED(mutex_);
  void refuse(std::int64_t tag, const std::string& request_id, const Error& error)
      ABSL_LOCKS_EXCLUDED(mutex_);
  // From the pump.
  [[nodiscard]] bool may_read() const override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool next_event(grpc::ByteBuffer* event) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void received(grpc::ByteBuffer* message) override ABSL_LOCKS_EXCLUDED(mutex_);
  void gone() override ABSL_LOCKS_EXCLUDED(mutex_);

  const LiveCalls::Token token_;
  const ServiceParts& parts_;
  Caller caller_;

  struct Held {
    std::shared_ptr<Job> job;
    std::int64_t tag;
  };
  std::optional<Held> held_ ABSL_GUARDED_BY(mutex_);  // was read, and waits for capacity in the queue
  bool admitting_ ABSL_GUARDED_BY(mutex_) = false;    // a thread is asking the scheduler to take it
  bool room_ ABSL_GUARDED_BY(mutex_) = false;         // capacity may have become free meanwhile
  std::unordered_map<const JobRecord*, std::shared_ptr<Job>> jobs_ ABSL_GUARDED_BY(mutex_);  // admitted
  std::deque<grpc::ByteBuffer> answers_ ABSL_GUARDED_BY(mutex_);                             // not sent yet
  std::optional<Error> end_ ABSL_GUARDED_BY(mutex_);  // why the call ends, unless the client closed it
};

}  // namespace marble::server
