// Sends a submitted job as a replay bundle, in pieces, because it may be larger than a message.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include "service/job_bundle.h"
#include "service/service_parts.h"
#include "service/stream_pump.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; the code that gathers the bundle owns it too, until the bundle is
/// complete.
class BundleCall final
    : public StreamPump<BundleCall, grpc::ServerWriteReactor<grpc::ByteBuffer>, v1::JobBundleResponse>,
      public TimerListener {
 public:
  static grpc::ServerWriteReactor<grpc::ByteBuffer>* begin(const ServiceParts& parts,
                                                           grpc::CallbackServerContext& context,
                                                           const grpc::ByteBuffer* request);

  // From the timer: a drain, or a client that reads nothing.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  BundleCall(const ServiceParts& parts, grpc::CallbackServerContext& context)
      : parts_(parts), context_(context) {}
  [[nodiscard]] Expected<void> start(const grpc::ByteBuffer* request) ABSL_LOCKS_EXCLUDED(mutex_);
  void gathered(const Expected<GatheredBundle>& bundle) ABSL_LOCKS_EXCLUDED(mutex_);
  // From the pump.
  [[nodiscard]] bool next_event(v1::JobBundleResponse* event) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const ServiceParts& parts_;
  grpc::CallbackServerContext& context_;
  GatheredBundle bundle_ ABSL_GUARDED_BY(mutex_);
  std::optional<Error> fault_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point piece_since_ ABSL_GUARDED_BY(mutex_);  // start of the newest piece's transmission
  bool began_ ABSL_GUARDED_BY(mutex_) = false;
  std::size_t requested_ ABSL_GUARDED_BY(mutex_) = 0;  // bytes of the request that were sent
  std::size_t answered_ ABSL_GUARDED_BY(mutex_) = 0;   // of the result
};

}  // namespace marble::server
