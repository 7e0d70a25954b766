#include "watch_call.h"

#include <algorithm>
#include <utility>

#include "admission.h"
#include "job_access.h"
#include "job_message.h"
#include "marble/convert.h"
#include "status.h"
#include "wire.h"

namespace marble::server {

constexpr int kMostEvents = 256;  // in one message

grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchCall::begin(const ServiceParts& parts,
                                                             std::atomic<int>& watchers,
                                                             const grpc::CallbackServerContext& context,
                                                             const grpc::ByteBuffer* request) {
  const std::shared_ptr<WatchCall> call(new WatchCall(parts, watchers));
  call->self_ = call;
  if (const auto started = call->start(context, request); !started) {
    {
      const MutexLock lock(call->mutex_);
      call->finishing_ = true;  // a client that goes away before it has heard must not end it again
    }
    call->Finish(to_status(started.error(), parts.scheduler.retry_delay_s()));
    return call.get();
  }
  parts.pulse.add(call);
  call->go_on();
  return call.get();
}

WatchCall::~WatchCall() {
  --watchers_;
  if (one_ != nullptr) one_->watch(false);
}

Expected<void> WatchCall::start(const grpc::CallbackServerContext& context, const grpc::ByteBuffer* request) {
  auto caller = parts_.access.identify(context);
  if (!caller) return unexpected(caller.error());
  caller_ = std::move(*caller);
  v1::WatchJobsRequest message;
  if (auto parsed = parse(request, &message); !parsed) return parsed;
  if (auto valid = check_progress(message.progress_interval_s(), 0); !valid) return valid;
  if (watchers_ > parts_.config.watchers) {
    return unexpected(Error{ErrorCode::resource_exhausted, "watchers", -1, "",
                            "at most " + std::to_string(parts_.config.watchers) + " may watch"});
  }
  interval_s_ = message.progress_interval_s();
  if (!message.job_id().empty()) {
    auto record = find_job(parts_.board, caller_, message.job_id());
    if (!record) return unexpected(record.error());
    one_ = std::move(*record);
    one_->watch(true);
  }
  const MutexLock lock(mutex_);
  finished_ = parts_.board.finished();
  return {};
}

bool WatchCall::next_of_one(v1::WatchJobsResponse* response) {
  const Clock::time_point now = Clock::now();
  const std::int64_t changes = one_->changes();  // before the rest: what comes later is told later
  const bool finished = one_->is_finished();
  if (changes == told_.changes && !finished) return false;
  const bool first = told_.changes < 0;
  const std::int64_t version = one_->snapshot().version;
  const bool waits = std::chrono::duration<double>(now - told_.at).count() < interval_s_;
  if (!first && version == told_.version && waits) return false;
  v1::JobEvent* event = response->add_events();
  if (first) {
    const JobRecord::Trace trace = one_->trace();
    to_message(trace, event->mutable_trace());
    cursor_ = trace.cursor;
  } else {
    const ProgressHistory::Rows taken = one_->read(cursor_);
    for (const Progress& row : taken.rows) marble::to_message(row, event->add_rows());
    skipped_ += taken.skipped;
  }
  to_message(*one_, event->mutable_job());
  response->set_skipped(skipped_);
  told_ = {changes, version, now};
  over_ = finished;
  return true;
}

// Which jobs have changed since they were told of. The finished ones are looked for first: whatever finishes
// in between is told of next time, and none twice.
void WatchCall::look_around() {
  const Clock::time_point now = Clock::now();
  JobBoard::Finished finished = parts_.board.finished_since(finished_);
  skipped_ += finished.skipped;
  for (auto& record : finished.records) {
    if (may_see(caller_, record->description().client)) to_tell_.push_back(std::move(record));
  }
  decltype(told_of_) told_of;  // what is not active any more is forgotten
  for (const auto& record : parts_.board.active()) {
    if (!may_see(caller_, record->description().client)) continue;
    const auto known = told_of_.find(record);
    Told& told = told_of.emplace(record, known == told_of_.end() ? Told{} : known->second).first->second;
    const std::int64_t changes = record->changes();
    if (changes == told.changes) continue;
    const std::int64_t version = record->snapshot().version;
    const bool waits = std::chrono::duration<double>(now - told.at).count() < interval_s_;
    if (told.changes >= 0 && version == told.version && waits) continue;
    told = {changes, version, now};
    to_tell_.push_back(record);
  }
  told_of_ = std::move(told_of);
}

bool WatchCall::next_of_all(v1::WatchJobsResponse* response) {
  if (to_tell_.empty()) look_around();
  while (!to_tell_.empty() && response->events_size() < kMostEvents) {
    const std::shared_ptr<JobRecord> record = std::move(to_tell_.front());
    to_tell_.pop_front();
    v1::JobEvent* event = response->add_events();
    to_message(*record, event->mutable_job());
    if (event->job().state() == v1::JOB_STATE_RUNNING && event->job().iterations() > 0)
      marble::to_message(record->newest(), event->add_rows());
  }
  response->set_skipped(skipped_);
  return response->events_size() > 0;
}

bool WatchCall::next_event(v1::WatchJobsResponse* response) {
  if (broken_ || over_) return false;
  return one_ != nullptr ? next_of_one(response) : next_of_all(response);
}

void WatchCall::OnWriteDone(bool ok) {
  {
    const MutexLock lock(mutex_);
    writing_ = false;
    if (!ok) broken_ = true;
    if (!broken_ && !over_ && to_tell_.empty()) return;  // the pulse looks again
  }
  go_on();
}

void WatchCall::OnCancel() {
  {
    const MutexLock lock(mutex_);
    broken_ = true;
  }
  go_on();
}

void WatchCall::OnDone() { const auto last = std::move(self_); }

void WatchCall::pulse(Clock::time_point /*now*/) { go_on(); }

// gRPC may react within StartWrite or Finish, on this very thread: no lock is held there.
void WatchCall::go_on() {
  v1::WatchJobsResponse response;
  grpc::Status status;
  bool write = false;
  {
    const MutexLock lock(mutex_);
    if (writing_ || finishing_) return;
    const bool drained = parts_.scheduler.is_drained();
    write = next_event(&response);
    if (!write && !over_ && !broken_ && !drained) return;
    if (!write && !over_) status = to_status({ErrorCode::unavailable, "", -1, "", "the server has drained"});
    writing_ = write;
    finishing_ = !write;
  }
  if (write) {
    bytes_ = serialize(response);
    StartWrite(&bytes_);
  } else {
    Finish(status);
  }
}

}  // namespace marble::server
