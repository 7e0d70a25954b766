// Receives an array, element by element, as fast as they are kept.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <optional>

#include "service/stream_pump.h"
#include "submissions/array_draft.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; elements on their way to the store own it too. Served as a
/// bidirectional stream, which looks the same on the wire.
class SubmitArrayCall final
    : public StreamPump<SubmitArrayCall, grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
                        v1::SubmitArrayResponse>,
      public TimerListener {
 public:
  static grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* begin(
      const ServiceParts& parts, grpc::CallbackServerContext& context);

  void OnReadDone(bool ok) override { read_done(ok); }
  // From the timer: drain.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  explicit SubmitArrayCall(const ServiceParts& parts) : token_(parts.calls), parts_(parts) {}
  [[nodiscard]] Expected<void> take(grpc::ByteBuffer* message) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<void> set_up(v1::ArraySetup setup) ABSL_LOCKS_EXCLUDED(mutex_);
  void seal(const std::shared_ptr<ArrayDraft>& draft, std::int64_t elements) ABSL_LOCKS_EXCLUDED(mutex_);
  void refuse(const Error& error) ABSL_LOCKS_EXCLUDED(mutex_);
  // From the pump.
  [[nodiscard]] bool may_read() const override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool next_event(v1::SubmitArrayResponse* event) override
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void received(grpc::ByteBuffer* message) override ABSL_LOCKS_EXCLUDED(mutex_);

  const LiveCalls::Token token_;
  const ServiceParts& parts_;
  Caller caller_;
  std::shared_ptr<ArrayDraft> draft_ ABSL_GUARDED_BY(mutex_);
  bool sealing_ ABSL_GUARDED_BY(mutex_) = false;  // the last message was received
  std::optional<v1::SubmitArrayResponse> answer_ ABSL_GUARDED_BY(mutex_);
  bool answered_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<Error> refused_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
