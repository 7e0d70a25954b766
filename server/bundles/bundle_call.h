// A submitted job as a replay bundle, in pieces: together they may be larger than a message.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include "bundles/job_bundle.h"
#include "service/service_parts.h"
#include "service/stream_pump.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; whoever gathers the bundle owns it too, until it is there.
class BundleCall final
    : public StreamPump<BundleCall, grpc::ServerWriteReactor<grpc::ByteBuffer>, v1::JobBundleResponse>,
      public Pulsed {
 public:
  static grpc::ServerWriteReactor<grpc::ByteBuffer>* begin(const ServiceParts& parts,
                                                           grpc::CallbackServerContext& context,
                                                           const grpc::ByteBuffer* request);

  // From the pulse: a drain, a client that takes nothing.
  void pulse(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  BundleCall(const ServiceParts& parts, grpc::CallbackServerContext& context)
      : parts_(parts), context_(context) {}
  [[nodiscard]] Expected<void> start(const grpc::ByteBuffer* request) ABSL_LOCKS_EXCLUDED(mutex_);
  void gathered(const Expected<GatheredBundle>& bundle) ABSL_LOCKS_EXCLUDED(mutex_);
  // The pump's.
  [[nodiscard]] bool next_event(v1::JobBundleResponse* event) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const ServiceParts& parts_;
  grpc::CallbackServerContext& context_;
  GatheredBundle bundle_ ABSL_GUARDED_BY(mutex_);
  std::optional<Error> fault_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point piece_since_ ABSL_GUARDED_BY(mutex_);  // the newest one is on its way
  bool began_ ABSL_GUARDED_BY(mutex_) = false;
  std::size_t requested_ ABSL_GUARDED_BY(mutex_) = 0;  // bytes that were told, of the request
  std::size_t answered_ ABSL_GUARDED_BY(mutex_) = 0;   // of the answer
};

}  // namespace marble::server
