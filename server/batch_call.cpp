#include "batch_call.h"

#include <utility>

#include "job_log.h"
#include "reply.h"
#include "status.h"
#include "wire.h"

namespace marble::server {

// Waits for one of the jobs.
class BatchCall::Item final : public JobObserver {
 public:
  Item(std::shared_ptr<BatchCall> call, std::shared_ptr<JobRecord> record, std::int64_t tag)
      : call_(std::move(call)), record_(std::move(record)), tag_(tag) {}
  void finished(Outcome outcome) override { call_->answer(tag_, *record_, outcome); }

 private:
  const std::shared_ptr<BatchCall> call_;
  const std::shared_ptr<JobRecord> record_;
  const std::int64_t tag_;
};

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* BatchCall::begin(
    const ServiceParts& parts, grpc::CallbackServerContext& context) {
  const std::shared_ptr<BatchCall> call(new BatchCall(parts));
  call->self_ = call;
  Origin origin = origin_of(context);
  auto caller = caller_of(parts, context, origin, Role::solve);
  if (!caller) {
    {
      const MutexLock lock(call->mutex_);
      call->finishing_ = true;  // a client that goes away before it has heard must not end it again
    }
    call->Finish(marble::server::refuse(parts, origin, caller.error()));
    return call.get();
  }
  call->caller_ = std::move(*caller);
  parts.pulse.add(call);
  call->go_on();
  return call.get();
}

void BatchCall::OnReadDone(bool ok) {
  v1::SolveBatchRequest request;
  const auto parsed = ok ? parse(&incoming_, &request) : Expected<void>{};
  if (ok && parsed) {
    (void)request.mutable_solve();  // an absent one is an empty one, and refused as such
    const std::string request_id = request.solve().request_id();
    auto job = make_job(parts_, caller_, JobKind::batch,
                        std::shared_ptr<const v1::SolveRequest>(request.release_solve()));
    if (job) {
      (*job)->observer = std::make_shared<Item>(self_, (*job)->record, request.tag());
      take(*job, request.tag());
    } else {
      refuse(request.tag(), request_id, inside("solve", job.error()));
    }
  }
  {
    const MutexLock lock(mutex_);
    reading_ = false;
    if (!ok) read_all_ = true;
    if (!parsed && !end_) end_ = parsed.error();
  }
  go_on();
}

// A new problem: admitted, or held until there is room.
void BatchCall::take(const std::shared_ptr<Job>& job, std::int64_t tag) {
  {
    const MutexLock lock(mutex_);
    if (broken_ || end_) {
      job->observer = nullptr;  // it holds the call
      return;
    }
    jobs_.emplace(job->record.get(), job);
    held_ = Held{job, tag};
    admitting_ = true;
    room_ = false;
  }
  admit(job, tag);
}

// By one thread at a time: when room comes while it asks, it asks again.
void BatchCall::admit(const std::shared_ptr<Job>& job, std::int64_t tag) {
  while (true) {
    const auto place = parts_.scheduler.admit(job, self_);
    const bool full = !place && place.error().code == ErrorCode::resource_exhausted;
    bool given_up = false;
    {
      const MutexLock lock(mutex_);
      given_up = broken_;
      if (full && parts_.scheduler.fits_alone(*job) && !given_up) {
        if (std::exchange(room_, false)) continue;
        admitting_ = false;
        return;
      }
      admitting_ = false;
      held_.reset();
      if (!place) {
        jobs_.erase(job->record.get());
        if (place.error().code == ErrorCode::unavailable && !end_) end_ = place.error();
      }
    }
    if (!place) {
      job->observer = nullptr;
      refuse(tag, job->record->description().request_id, place.error());
    } else if (given_up) {
      parts_.scheduler.cancel(job);
    }
    return;
  }
}

void BatchCall::room() {
  std::optional<Held> held;
  {
    const MutexLock lock(mutex_);
    if (admitting_) {
      room_ = true;
    } else if (held_) {
      held = held_;
      admitting_ = true;
    }
  }
  if (held) admit(held->job, held->tag);
  go_on();
}

void BatchCall::refuse(std::int64_t tag, const std::string& request_id, const Error& error) {
  parts_.scheduler.count_refused(error);
  Origin origin = caller_.origin;
  origin.request_id = request_id;
  log_refusal(parts_.log, origin, error);
  v1::SolveBatchResponse response;
  response.set_tag(tag);
  *response.mutable_error() = to_message(error, parts_.scheduler.retry_delay_s());
  const MutexLock lock(mutex_);
  answers_.push_back(serialize(response));
}

void BatchCall::answer(std::int64_t tag, const JobRecord& record, const Outcome& outcome) {
  v1::SolveBatchResponse response;
  response.set_tag(tag);
  if (const auto filled = fill_response(record, outcome, response.mutable_result()); !filled) {
    *response.mutable_error() = to_message(filled.error(), outcome.retry_delay_s);
  }
  {
    const MutexLock lock(mutex_);
    jobs_.erase(&record);
    if (!broken_) answers_.push_back(serialize(response));
  }
  go_on();
}

void BatchCall::OnWriteDone(bool ok) {
  {
    const MutexLock lock(mutex_);
    writing_ = false;
    if (!ok) broken_ = true;
  }
  go_on();
}

void BatchCall::OnCancel() {
  std::vector<std::shared_ptr<Job>> jobs;
  {
    const MutexLock lock(mutex_);
    broken_ = true;
    answers_.clear();
    if (held_ && !admitting_) {
      jobs_.erase(held_->job->record.get());
      held_->job->observer = nullptr;
      held_.reset();
    }
    for (const auto& [record, job] : jobs_) jobs.push_back(job);
  }
  for (const auto& job : jobs) parts_.scheduler.cancel(job);
  go_on();
}

void BatchCall::OnDone() { const auto last = std::move(self_); }

void BatchCall::pulse(Clock::time_point /*now*/) {
  if (!parts_.scheduler.is_closed()) return;
  {
    const MutexLock lock(mutex_);
    if (finishing_) return;
    if (!end_ && !read_all_) end_ = draining();
  }
  go_on();
}

// A thread of ours may ask for a read while gRPC's tells that the client is gone. Finishing waits until it
// has asked: afterwards gRPC may be done with the call, and asking would use memory it has freed.
void BatchCall::go_on() {
  while (step()) {
  }
}

// gRPC may react within StartRead, StartWrite or Finish, on this very thread: no lock is held there.
bool BatchCall::step() {
  bool read = false;
  bool write = false;
  bool finish = false;
  grpc::Status status;
  {
    const MutexLock lock(mutex_);
    const std::size_t open = jobs_.size() + answers_.size();
    read = !reading_ && !read_all_ && !end_ && !broken_ && !finishing_ && !held_ &&
           open < static_cast<std::size_t>(parts_.config.batch_window);
    reading_ = reading_ || read;
    starting_ += read ? 1 : 0;
    if (!writing_ && !finishing_) {
      write = !answers_.empty() && !broken_;
      if (write) {
        outgoing_.Swap(&answers_.front());
        answers_.pop_front();
      }
      writing_ = write;
      finish = !write && starting_ == 0 && jobs_.empty() && !held_ && (read_all_ || end_ || broken_);
      finishing_ = finish;
      if (finish && end_) status = end_of_stream(parts_, *end_);
    }
  }
  if (read) StartRead(&incoming_);
  if (write) {
    StartWrite(&outgoing_);
  } else if (finish) {
    Finish(status);
  }
  if (!read) return false;
  const MutexLock lock(mutex_);
  --starting_;
  return true;
}

}  // namespace marble::server
