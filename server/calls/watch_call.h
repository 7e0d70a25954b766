// Streams live events of one job or of all jobs, as fast as the client reads them and at most once per timer
// tick.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include "service/job_feed.h"
#include "service/service_parts.h"
#include "service/stream_pump.h"

namespace marble::server {

/// Owns itself until gRPC is done with it.
class WatchCall final
    : public StreamPump<WatchCall, grpc::ServerWriteReactor<grpc::ByteBuffer>, v1::WatchJobsResponse>,
      public TimerListener {
 public:
  static grpc::ServerWriteReactor<grpc::ByteBuffer>* begin(const ServiceParts& parts,
                                                           grpc::CallbackServerContext& context,
                                                           const grpc::ByteBuffer* request);

  // From the timer.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  explicit WatchCall(const ServiceParts& parts) : parts_(parts) {}
  [[nodiscard]] Expected<void> start(grpc::CallbackServerContext& context, const grpc::ByteBuffer* request)
      ABSL_LOCKS_EXCLUDED(mutex_);
  // From the pump.
  [[nodiscard]] bool next_event(v1::WatchJobsResponse* event) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool wrote() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const ServiceParts& parts_;
  std::unique_ptr<JobFeed> feed_ ABSL_GUARDED_BY(mutex_);
  bool drained_ ABSL_GUARDED_BY(mutex_) = false;  // state before the last read of the feed
};

}  // namespace marble::server
