// A streamed solve: accepted → started → progress … → result, with one write in progress.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <cstddef>
#include <deque>
#include <optional>

#include "base/origin.h"
#include "jobs/progress_slot.h"
#include "marble/v1/service.pb.h"
#include "service/service_parts.h"
#include "service/stream_pump.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; its job owns it too, until it has finished.
class SolveStreamCall final
    : public StreamPump<SolveStreamCall, grpc::ServerWriteReactor<grpc::ByteBuffer>, v1::SolveStreamResponse>,
      public JobObserver,
      public ProgressSink,
      public TimerListener {
 public:
  /// The field that a request of many problems must have, for a method that takes only such requests.
  struct Made {
    const char* of = nullptr;  ///< the field of SolveRequest
    bool (v1::SolveRequest::*has)() const = nullptr;
  };
  /// Parses, checks and admits the request, or refuses it.
  static grpc::ServerWriteReactor<grpc::ByteBuffer>* begin(const ServiceParts& parts,
                                                           grpc::CallbackServerContext& context,
                                                           const grpc::ByteBuffer* request, Made made);

  // From the scheduler.
  [[nodiscard]] bool wants_place() const override { return true; }
  void moved(const QueuePlace& place) override ABSL_LOCKS_EXCLUDED(mutex_);
  void started(double queue_s) override ABSL_LOCKS_EXCLUDED(mutex_);
  ProgressSink* progress() override { return this; }
  void report(const Progress& progress) override ABSL_LOCKS_EXCLUDED(mutex_);
  void finished(Outcome outcome) override ABSL_LOCKS_EXCLUDED(mutex_);
  // From the timer: rows that wait for others.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  explicit SolveStreamCall(const ServiceParts& parts) : parts_(parts) {}
  [[nodiscard]] Expected<void> admit(const grpc::ByteBuffer* bytes,
                                     const grpc::CallbackServerContext& context, Origin& origin, Made made)
      ABSL_LOCKS_EXCLUDED(mutex_);
  // From the pump.
  [[nodiscard]] bool next_event(v1::SolveStreamResponse* event) override
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void gone() override;

  const ServiceParts& parts_;
  double progress_interval_s_ = 0.0;  // constant once admitted, like job_
  int iterate_every_ = 0;
  std::shared_ptr<Job> job_;
  ProgressSlot slot_;
  double last_progress_s_ = -1.0;  // used by the worker only

  std::size_t reported_stages_ ABSL_GUARDED_BY(mutex_) = 0;
  std::deque<SampleAverageStage> stages_ ABSL_GUARDED_BY(mutex_);  // not sent yet
  bool admitted_ ABSL_GUARDED_BY(mutex_) = false;                  // its place is known
  bool accepted_ ABSL_GUARDED_BY(mutex_) = false;                  // was sent
  bool started_ ABSL_GUARDED_BY(mutex_) = false;             // a worker runs the job: its place is outdated
  QueuePlace reported_place_ ABSL_GUARDED_BY(mutex_);        // the newest place that was sent
  std::optional<QueuePlace> place_ ABSL_GUARDED_BY(mutex_);  // accepted or moved, not sent yet
  std::optional<double> queue_s_ ABSL_GUARDED_BY(mutex_);    // started, not sent yet
  std::optional<Outcome> outcome_ ABSL_GUARDED_BY(mutex_);   // finished, not sent yet
  grpc::Status status_ ABSL_GUARDED_BY(mutex_);              // of a job that has finished
  bool over_ ABSL_GUARDED_BY(mutex_) = false;                // the job has finished
};

}  // namespace marble::server
