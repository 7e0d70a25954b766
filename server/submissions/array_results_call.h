// Sends the results of an array at its client's pace.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <deque>
#include <optional>
#include <string>

#include "base/identity.h"
#include "service/service_parts.h"
#include "service/stream_pump.h"
#include "store/array_source.h"

namespace marble::server {

/// Owns itself until gRPC is done with it. Results that its client has not read stay in the store, except
/// for one page.
class ArrayResultsCall final
    : public StreamPump<ArrayResultsCall, grpc::ServerWriteReactor<grpc::ByteBuffer>, grpc::ByteBuffer>,
      public ArrayListener,
      public TimerListener,
      public std::enable_shared_from_this<ArrayResultsCall> {
 public:
  static grpc::ServerWriteReactor<grpc::ByteBuffer>* begin(const ServiceParts& parts,
                                                           grpc::CallbackServerContext& context,
                                                           const grpc::ByteBuffer* request);
  ~ArrayResultsCall() override;
  ArrayResultsCall(const ArrayResultsCall&) = delete;
  ArrayResultsCall& operator=(const ArrayResultsCall&) = delete;

  void news() override { go_on(); }
  // From the timer: drain.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  explicit ArrayResultsCall(const ServiceParts& parts) : token_(parts.calls), parts_(parts) {}
  [[nodiscard]] Expected<void> start(grpc::CallbackServerContext& context, const grpc::ByteBuffer* request)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Errors: not_found, invalid_argument, resource_exhausted (too many readers).
  [[nodiscard]] Expected<void> open(const Identity& caller, const v1::ArrayResultsRequest& message,
                                    const FoundArray& found) ABSL_LOCKS_EXCLUDED(mutex_);
  // From the pump.
  [[nodiscard]] bool next_event(grpc::ByteBuffer* event) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool work() override ABSL_LOCKS_EXCLUDED(mutex_);

  const LiveCalls::Token token_;
  const ServiceParts& parts_;
  std::string client_;  // whose feeds include this one; empty: not counted yet
  std::shared_ptr<ArraySource> array_ ABSL_GUARDED_BY(mutex_);  // null until it is found
  std::deque<ElementAnswer> page_ ABSL_GUARDED_BY(mutex_);      // not sent yet
  std::int64_t read_ ABSL_GUARDED_BY(mutex_) = 0;               // read up to this one
  bool reading_ ABSL_GUARDED_BY(mutex_) = false;                // a thread is reading
  bool again_ ABSL_GUARDED_BY(mutex_) = false;                  // more arrived meanwhile
  std::optional<grpc::Status> end_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
