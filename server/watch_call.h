// Live events of one job or of all, as fast as the reader takes them and no faster than the pulse.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <deque>
#include <unordered_map>

#include "marble/v1/job.pb.h"
#include "service_parts.h"

namespace marble::server {

/// Owns itself until gRPC is done with it. It looks at the jobs' records when it can write: a slow reader
/// costs nothing but what it misses.
class WatchCall final : public grpc::ServerWriteReactor<grpc::ByteBuffer>, public Pulsed {
 public:
  /// `watchers` counts the calls alive.
  static grpc::ServerWriteReactor<grpc::ByteBuffer>* begin(const ServiceParts& parts,
                                                           std::atomic<int>& watchers,
                                                           const grpc::CallbackServerContext& context,
                                                           const grpc::ByteBuffer* request);
  ~WatchCall() override;

  // From gRPC.
  void OnWriteDone(bool ok) override ABSL_LOCKS_EXCLUDED(mutex_);
  void OnCancel() override ABSL_LOCKS_EXCLUDED(mutex_);
  void OnDone() override;
  // From the pulse.
  void pulse(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  WatchCall(const ServiceParts& parts, std::atomic<int>& watchers)
      : token_(parts.calls), parts_(parts), watchers_(watchers) {
    ++watchers_;
  }
  [[nodiscard]] Expected<void> start(const grpc::CallbackServerContext& context,
                                     const grpc::ByteBuffer* request);
  void go_on() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool next_event(v1::WatchJobsResponse* response) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool next_of_one(v1::WatchJobsResponse* response) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool next_of_all(v1::WatchJobsResponse* response) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void look_around() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const LiveCalls::Token token_;
  const ServiceParts& parts_;
  std::atomic<int>& watchers_;
  Identity caller_;
  double interval_s_ = 0.0;
  std::shared_ptr<JobRecord> one_;  // null: all
  std::shared_ptr<WatchCall> self_;
  grpc::ByteBuffer bytes_;  // the write in flight

  Mutex mutex_;
  // Of a job: what was told of it, and when.
  struct Told {
    std::int64_t changes = -1, version = -1;
    Clock::time_point at = {};
  };
  Told told_ ABSL_GUARDED_BY(mutex_);  // of one
  std::int64_t cursor_ ABSL_GUARDED_BY(mutex_) = 0;
  std::unordered_map<std::shared_ptr<JobRecord>, Told> told_of_
      ABSL_GUARDED_BY(mutex_);                                              // of all that are active
  std::deque<std::shared_ptr<JobRecord>> to_tell_ ABSL_GUARDED_BY(mutex_);  // have changed
  std::int64_t finished_ ABSL_GUARDED_BY(mutex_) = 0;                       // cursor of the board
  std::int64_t skipped_ ABSL_GUARDED_BY(mutex_) = 0;
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;  // nobody reads any more
  bool over_ ABSL_GUARDED_BY(mutex_) = false;    // the last event was written
  bool finishing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::server
