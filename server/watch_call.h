// Live events of one job or of all, as fast as the reader takes them and no faster than the pulse.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include "job_feed.h"
#include "service_parts.h"

namespace marble::server {

/// Owns itself until gRPC is done with it.
class WatchCall final : public grpc::ServerWriteReactor<grpc::ByteBuffer>, public Pulsed {
 public:
  static grpc::ServerWriteReactor<grpc::ByteBuffer>* begin(const ServiceParts& parts,
                                                           grpc::CallbackServerContext& context,
                                                           const grpc::ByteBuffer* request);

  // From gRPC.
  void OnWriteDone(bool ok) override ABSL_LOCKS_EXCLUDED(mutex_);
  void OnCancel() override ABSL_LOCKS_EXCLUDED(mutex_);
  void OnDone() override;
  // From the pulse.
  void pulse(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  explicit WatchCall(const ServiceParts& parts) : parts_(parts) {}
  [[nodiscard]] Expected<void> start(grpc::CallbackServerContext& context, const grpc::ByteBuffer* request)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void go_on() ABSL_LOCKS_EXCLUDED(mutex_);

  const ServiceParts& parts_;
  std::shared_ptr<WatchCall> self_;
  grpc::ByteBuffer bytes_;  // the write in flight

  Mutex mutex_;
  std::unique_ptr<JobFeed> feed_ ABSL_GUARDED_BY(mutex_);
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;  // nobody reads any more
  bool finishing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::server
