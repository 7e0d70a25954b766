// One streamed solve: accepted → started → progress … → result, with one write in flight.
#pragma once

#include <absl/base/thread_annotations.h>
#include <absl/synchronization/mutex.h>
#include <grpcpp/support/server_callback.h>

#include "marble/v1/service.pb.h"
#include "progress_slot.h"
#include "scheduler.h"

namespace marble::server {

/// Fills the response from a job's outcome, or tells the status of the error it ended with.
[[nodiscard]] grpc::Status fill_response(const Job& job, Outcome outcome, const Scheduler& scheduler,
                                         v1::SolveResponse* response);
/// One line for a request that did not become a job.
void log_refusal(const Log& log, const std::string& peer, const v1::SolveRequest& request,
                 const Error& error);

/// Deletes itself when gRPC is done with it, which is not before the job has finished.
class SolveStreamCall final : public grpc::ServerWriteReactor<v1::SolveStreamResponse>,
                              public JobObserver,
                              public ProgressSink {
 public:
  SolveStreamCall(Scheduler& scheduler, const Log& log, const grpc::CallbackServerContext& context,
                  const v1::SolveStreamRequest& request);

  // From gRPC.
  void OnWriteDone(bool ok) override ABSL_LOCKS_EXCLUDED(mutex_);
  void OnCancel() override;
  void OnDone() override { delete this; }

  // From the worker.
  void started(double queue_s) override ABSL_LOCKS_EXCLUDED(mutex_);
  ProgressSink* progress() override { return this; }
  void report(const Progress& progress) override ABSL_LOCKS_EXCLUDED(mutex_);
  void finished(Outcome outcome) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  enum class Next { nothing, write, finish };
  [[nodiscard]] Next choose_next() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void go_on() ABSL_LOCKS_EXCLUDED(mutex_);

  Scheduler& scheduler_;
  const double progress_interval_s_;
  const int iterate_every_;
  std::shared_ptr<Job> job_;
  ProgressSlot slot_;
  double last_progress_s_ = -1.0;  // worker only

  absl::Mutex mutex_;
  v1::SolveStreamResponse message_ ABSL_GUARDED_BY(mutex_);  // the write in flight
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;  // a write failed: nobody reads any more
  bool accepted_due_ ABSL_GUARDED_BY(mutex_) = false;
  bool started_due_ ABSL_GUARDED_BY(mutex_) = false;
  bool result_due_ ABSL_GUARDED_BY(mutex_) = false;
  bool over_ ABSL_GUARDED_BY(mutex_) = false;       // the job has finished
  bool finishing_ ABSL_GUARDED_BY(mutex_) = false;  // Finish was called or is about to be
  int queue_position_ ABSL_GUARDED_BY(mutex_) = 0;
  double queue_s_ ABSL_GUARDED_BY(mutex_) = 0.0;
  v1::SolveResponse result_ ABSL_GUARDED_BY(mutex_);
  grpc::Status status_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
