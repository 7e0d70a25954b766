// A session on its stream: reads updates, has them solved one after the other, and writes their results.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <deque>
#include <optional>

#include "calls/waiting_updates.h"
#include "jobs/progress_slot.h"
#include "marble/warm_solver.h"
#include "service/admission.h"
#include "service/service_parts.h"
#include "service/stream_pump.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; its jobs own it too, until they have finished. It occupies no
/// worker and no job while there is nothing to solve.
class SessionCall final
    : public StreamPump<SessionCall, grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
                        v1::SessionResponse>,
      public ProgressSink,
      public TimerListener {
 public:
  static grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* begin(
      const ServiceParts& parts, grpc::CallbackServerContext& context);

  void OnReadDone(bool ok) override { read_done(ok); }
  // From the worker.
  void report(const Progress& progress) override ABSL_LOCKS_EXCLUDED(mutex_);
  // From the timer: idle time, drain.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  class SetupObserver;
  class UpdateObserver;
  explicit SessionCall(const ServiceParts& parts) : token_(parts.calls), parts_(parts) {}

  void take_message(grpc::ByteBuffer& bytes, std::unique_ptr<Scheduler::Held> room)
      ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<void> take_setup(const std::shared_ptr<const v1::SessionSetup>& message)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void take_update(v1::SessionUpdate& message, std::unique_ptr<Scheduler::Held> room)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void set_up_done(Outcome outcome) ABSL_LOCKS_EXCLUDED(mutex_);
  void update_done(const std::shared_ptr<Update>& update, Outcome outcome) ABSL_LOCKS_EXCLUDED(mutex_);

  // From the pump.
  [[nodiscard]] bool may_read() const override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool next_event(v1::SessionResponse* event) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::optional<grpc::Status> ending() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool wrote() override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void received(grpc::ByteBuffer* message) override ABSL_LOCKS_EXCLUDED(mutex_);
  bool work() override ABSL_LOCKS_EXCLUDED(mutex_);
  void gone() override ABSL_LOCKS_EXCLUDED(mutex_);
  void done() override ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] bool is_over() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] bool take_unread(grpc::ByteBuffer* bytes, std::unique_ptr<Scheduler::Held>* room)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::shared_ptr<Job> next_job() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::shared_ptr<Job> make_job(Clock::time_point deadline);
  void take_rows() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void refuse(std::int64_t sequence, const Error& error, double retry_delay_s = 0.0)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void end(const Error& reason) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void cancel(const Error& reason) ABSL_LOCKS_EXCLUDED(mutex_);
  void release() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const LiveCalls::Token token_;
  const ServiceParts& parts_;
  Caller caller_;
  Quota quota_;
  ProgressSlot slot_;
  double last_progress_s_ = -1.0;  // used by the worker only
  // Constant once set up.
  Priority priority_ = Priority::realtime;
  bool report_progress_ = false;
  double progress_interval_s_ = 0.0;
  int iterate_every_ = 0;
  std::int64_t epoch_ = 0;
  std::shared_ptr<JobRecord> record_;
  PartSizes sizes_;
  std::optional<WarmSolver> solver_;  // used by the job in progress

  std::unique_ptr<SessionTable::Place> place_ ABSL_GUARDED_BY(mutex_);
  Options options_ ABSL_GUARDED_BY(mutex_);                         // options of the newest update
  std::optional<grpc::ByteBuffer> unread_ ABSL_GUARDED_BY(mutex_);  // a message that is not parsed yet
  std::optional<WaitingUpdates> waiting_ ABSL_GUARDED_BY(mutex_);   // exists once there is a set-up
  std::shared_ptr<Job> job_ ABSL_GUARDED_BY(mutex_);                // job in progress
  std::int64_t solving_ ABSL_GUARDED_BY(mutex_) = 0;                // sequence number of that update
  std::int64_t newest_sequence_ ABSL_GUARDED_BY(mutex_) = 0;
  bool any_update_ ABSL_GUARDED_BY(mutex_) = false;
  std::deque<v1::SessionResponse> events_ ABSL_GUARDED_BY(mutex_);  // not sent yet
  int answers_ ABSL_GUARDED_BY(mutex_) = 0;                         // number of results among them
  std::int64_t restarts_ ABSL_GUARDED_BY(mutex_) = 0;               // restarts that were reported
  Clock::time_point last_activity_ ABSL_GUARDED_BY(mutex_) = Clock::now();
  bool set_up_ ABSL_GUARDED_BY(mutex_) = false;
  bool parsing_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<Error> end_ ABSL_GUARDED_BY(mutex_);  // why the session ends, unless the client closed it
};

class SessionCall::SetupObserver final : public JobObserver {
 public:
  explicit SetupObserver(std::shared_ptr<SessionCall> call) : call_(std::move(call)) {}
  void finished(Outcome outcome) override { call_->set_up_done(std::move(outcome)); }

 private:
  const std::shared_ptr<SessionCall> call_;
};

class SessionCall::UpdateObserver final : public JobObserver {
 public:
  UpdateObserver(std::shared_ptr<SessionCall> call, std::shared_ptr<Update> update)
      : call_(std::move(call)), update_(std::move(update)) {}
  ProgressSink* progress() override { return call_->report_progress_ ? call_.get() : nullptr; }
  void finished(Outcome outcome) override { call_->update_done(update_, std::move(outcome)); }

 private:
  const std::shared_ptr<SessionCall> call_;
  const std::shared_ptr<Update> update_;
};

}  // namespace marble::server
