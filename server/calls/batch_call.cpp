#include "calls/batch_call.h"

#include <utility>

#include "base/status.h"
#include "base/wire.h"
#include "service/reply.h"

namespace marble::server {

// The observer of one of the jobs.
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
    call->end_at_once(refused(parts, origin, caller.error()));
    return call.get();
  }
  call->caller_ = std::move(*caller);
  parts.timer.add(call);
  call->go_on();
  return call.get();
}

void BatchCall::received(grpc::ByteBuffer* message) {
  if (message == nullptr) return;
  v1::SolveBatchRequest request;
  if (const auto parsed = parse(message, &request); !parsed) {
    const MutexLock lock(mutex_);
    if (!end_) end_ = parsed.error();
    return;
  }
  (void)request.mutable_solve();  // a missing problem counts as an empty one, which is refused
  const std::string request_id = request.solve().request_id();
  auto job = make_job(parts_, caller_, JobKind::batch,
                      std::shared_ptr<const v1::SolveRequest>(request.release_solve()));
  if (!job) return refuse(request.tag(), request_id, inside("solve", job.error()));
  (*job)->observer = std::make_shared<Item>(self_, (*job)->record, request.tag());
  take(*job, request.tag());
}

// A new problem: admitted, or held until there is capacity.
void BatchCall::take(const std::shared_ptr<Job>& job, std::int64_t tag) {
  {
    const MutexLock lock(mutex_);
    if (broken() || end_) {
      job->observer = nullptr;  // the observer owns the call
      return;
    }
    jobs_.emplace(job->record.get(), job);
    held_ = Held{job, tag};
    admitting_ = true;
    room_ = false;
  }
  admit(job, tag);
}

// By one thread at a time: if capacity becomes free meanwhile, it tries again.
void BatchCall::admit(const std::shared_ptr<Job>& job, std::int64_t tag) {
  while (true) {
    const auto place = parts_.scheduler.admit(job, self_);
    const bool full = !place && place.error().code == ErrorCode::resource_exhausted;
    bool given_up = false;
    {
      const MutexLock lock(mutex_);
      given_up = broken();
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
  Origin origin = caller_.origin;
  origin.request_id = request_id;
  note_refusal(parts_, origin, error);
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
    if (!broken()) answers_.push_back(serialize(response));
  }
  go_on();
}

void BatchCall::gone() {
  std::vector<std::shared_ptr<Job>> jobs;
  {
    const MutexLock lock(mutex_);
    answers_.clear();
    if (held_ && !admitting_) {
      jobs_.erase(held_->job->record.get());
      held_->job->observer = nullptr;
      held_.reset();
    }
    for (const auto& [record, job] : jobs_) jobs.push_back(job);
  }
  for (const auto& job : jobs) parts_.scheduler.cancel(job);
}

void BatchCall::on_timer(Clock::time_point /*now*/) {
  if (!parts_.scheduler.is_closed()) return;
  {
    const MutexLock lock(mutex_);
    if (finishing()) return;
    if (!end_ && !read_all()) end_ = draining();
  }
  go_on();
}

bool BatchCall::may_read() const {
  return !end_ && !held_ &&
         jobs_.size() + answers_.size() < static_cast<std::size_t>(parts_.config.batch_window);
}

bool BatchCall::next_event(grpc::ByteBuffer* event) {
  if (answers_.empty()) return false;
  event->Swap(&answers_.front());
  answers_.pop_front();
  return true;
}

std::optional<grpc::Status> BatchCall::ending() {
  if (!jobs_.empty() || held_ || !(read_all() || end_ || broken())) return std::nullopt;
  return end_ ? end_of_stream(parts_, *end_) : grpc::Status::OK;
}

}  // namespace marble::server
