#include "submissions/recovery.h"

#include <algorithm>

#include "base/random_id.h"
#include "google/rpc/status.pb.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "messages/job_message.h"
#include "service/admission.h"
#include "submissions/result_keeper.h"
#include "wire/status.h"

namespace marble::server {
namespace {

grpc::ByteBuffer buffer_of(const std::string& bytes) {
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

}  // namespace

Expected<std::shared_ptr<Recovery>> Recovery::begin(const ServiceParts& parts, JobStore& store) {
  const std::shared_ptr<Recovery> recovery(new Recovery(parts, store));
  if (auto taken = recovery->take_up_answers(); !taken) return unexpected(taken.error());
  if (auto taken = recovery->take_up_jobs(); !taken) return unexpected(taken.error());
  recovery->room();
  return recovery;
}

Expected<void> Recovery::take_up_answers() {
  return store_.each_result([&](const StoredResult& stored) {
    if (!parts_.results.expect(stored.id, stored.client, {stored.request_id, stored.digest})) return;
    v1::GetJobResponse message;
    if (message.ParseFromString(stored.job)) {
      const Options options = options_of(message.options()).value_or(Options());
      const auto record = parts_.board.make(description_of(message.job()), options);
      record->restore(snapshot_of(message.job()), trace_of(message.trace()));
      parts_.board.add(record);
      parts_.board.finish(record);
    }
    ResultStore::Result result{buffer_of(stored.answer), 0.0};
    if (google::rpc::Status error; !stored.error.empty() && error.ParseFromString(stored.error))
      result.answer = unexpected(error_of(error));
    const auto age = std::chrono::system_clock::now() - time_of(stored.finished_unix_s);
    parts_.results.put(stored.id, std::move(result),
                       Clock::now() - std::chrono::duration_cast<Clock::duration>(age));
  });
}

Expected<void> Recovery::take_up_jobs() {
  auto jobs = store_.unanswered();
  if (!jobs) return unexpected(jobs.error());
  const MutexLock lock(mutex_);
  for (StoredJob& job : *jobs) {
    if (!parts_.results.expect(job.id, job.client, {job.request_id, job.digest})) continue;
    if (job.cancelled) {
      end(job, failure(ErrorCode::cancelled, "given up before the server was started again"));
    } else {
      waiting_.push_back(std::move(job));
    }
  }
  parts_.log.info(Component::server, "jobs_taken_up", {{"jobs", static_cast<std::int64_t>(waiting_.size())}});
  return {};
}

void Recovery::room() {
  const MutexLock lock(mutex_);
  while (!waiting_.empty()) {
    const StoredJob& stored = waiting_.front();
    if (parts_.results.owner(stored.id).empty()) {  // deleted meanwhile
      next_ = nullptr;
      waiting_.pop_front();
      continue;
    }
    if (next_ == nullptr) {
      auto job = remade(stored);
      if (!job) {
        end(stored, job.error());
        waiting_.pop_front();
        continue;
      }
      next_ = std::move(*job);
    }
    const auto place = parts_.scheduler.admit(next_, weak_from_this());
    if (!place) {
      if (parts_.scheduler.is_closed() || parts_.scheduler.fits_alone(*next_)) return;
      end(stored, place.error());
    }
    next_ = nullptr;
    waiting_.pop_front();
  }
}

// As it was when it came, but by what its client may have and what the server's defaults are now.
Expected<std::shared_ptr<Job>> Recovery::remade(const StoredJob& stored) const {
  const auto bytes = store_.request_of(stored.id);
  if (!bytes) return unexpected(bytes.error());
  const auto request = std::make_shared<v1::SolveRequest>();
  if (!request->ParseFromString(*bytes))
    return unexpected(failure(ErrorCode::internal, "the stored request cannot be read"));
  const auto highest = static_cast<std::int64_t>(parts_.access.quota_of(stored.client).priority);
  request->set_priority(to_message(static_cast<Priority>(std::max(stored.priority, highest))));
  const Caller caller{.identity = {.client = stored.client, .roles = {}},
                      .origin = {.peer = stored.peer,
                                 .client = stored.client,
                                 .request_id = stored.request_id,
                                 .trace = parse_traceparent(stored.traceparent, random_id())},
                      .earlier = Caller::Earlier{stored.id, time_of(stored.accepted_unix_s)}};
  auto job = make_job(parts_, caller, JobKind::submitted, request);
  if (!job) return job;
  const auto keeper = std::make_shared<ResultKeeper>(parts_, &store_, (*job)->record);
  keeper->added();
  (*job)->observer = keeper;
  return job;
}

// Its answer is this error.
void Recovery::end(const StoredJob& stored, const Error& error) const {
  const auto record = parts_.board.make({.id = stored.id,
                                         .kind = JobKind::submitted,
                                         .priority = static_cast<Priority>(stored.priority),
                                         .client = stored.client,
                                         .request_id = stored.request_id,
                                         .peer = stored.peer,
                                         .accepted = time_of(stored.accepted_unix_s)},
                                        Options());
  record->finished(unexpected(error), 0.0, 0.0);
  parts_.board.add(record);
  parts_.board.finish(record);
  ResultKeeper keeper(parts_, &store_, record);
  keeper.added();
  keeper.finished({.solution = unexpected(error)});
}

}  // namespace marble::server
