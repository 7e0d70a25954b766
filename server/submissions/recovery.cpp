#include "submissions/recovery.h"

#include <algorithm>

#include "base/fault_point.h"
#include "base/random_id.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "service/admission.h"
#include "service/job_message.h"
#include "service/stored_job.h"
#include "submissions/result_keeper.h"

namespace marble::server {

Expected<std::shared_ptr<Recovery>> Recovery::begin(const ServiceParts& parts, Arrays& arrays,
                                                    JobStore& store) {
  const std::shared_ptr<Recovery> recovery(new Recovery(parts, arrays, store));
  MARBLE_RETURN_IF_ERROR(recovery->take_up_answers());
  MARBLE_RETURN_IF_ERROR(recovery->take_up_jobs());
  recovery->room();
  return recovery;
}

// Two rows with one request id are two jobs.
void Recovery::expect(const std::string& id, const std::string& client,
                      const ResultStore::RequestName& name) const {
  const auto known = parts_.results.expect(id, client, name);
  if (!known || *known != id) (void)parts_.results.expect(id, client);
}

Expected<void> Recovery::take_up_answers() {
  std::vector<StoredResult> arrays;
  auto read = store_.each_result([&](StoredResult stored) {
    expect(stored.id, stored.client, {stored.request_id, stored.digest});
    if (stored.elements) return arrays.push_back(std::move(stored));  // the store reads one thing at a time
    const auto record = stored_record(parts_.board, stored);
    parts_.board.add(record);
    parts_.board.finish(record);
    if (stored.request_bytes >= 0 && parts_.config.bundles > 0)
      parts_.results.keep_request(stored.id, {nullptr, stored.request_bytes});
    const auto age = std::max<std::chrono::system_clock::duration>(
        std::chrono::system_clock::now() - time_of(stored.finished_unix_s), {});
    parts_.results.put(stored.id, stored_answer(stored.answer, stored.error),
                       Clock::now() - std::chrono::duration_cast<Clock::duration>(age));
  });
  for (const StoredResult& stored : arrays) {
    if (!read) break;
    read = arrays_.take_up_answered(stored, stored_record(parts_.board, stored));
  }
  return read;
}

// An array that was not complete is treated as if it had never been sent.
Expected<void> Recovery::take_up_array(const StoredJob& stored) {
  if (*stored.elements == 0) {
    store_.forget(stored.id);
    return {};
  }
  expect(stored.id, stored.client, {stored.request_id, stored.digest});
  return arrays_.take_up(stored);
}

Expected<void> Recovery::take_up_jobs() {
  MARBLE_ASSIGN_OR_RETURN(auto jobs, store_.unanswered());
  for (const StoredJob& job : jobs) {
    if (!job.elements) continue;
    MARBLE_RETURN_IF_ERROR(take_up_array(job));
  }
  const MutexLock lock(mutex_);
  for (StoredJob& job : jobs) {
    if (job.elements) continue;
    expect(job.id, job.client, {job.request_id, job.digest});
    if (parts_.config.bundles > 0) parts_.results.keep_request(job.id, {nullptr, job.request_bytes});
    if (job.cancelled) {
      end(job, failure(ErrorCode::cancelled, "given up before the server was started again"));
    } else if (job.lost >= parts_.config.job_starts) {
      log_set_aside(parts_.log, job, static_cast<int>(job.lost));
      end(job, set_aside(static_cast<int>(job.lost)));
    } else if (job.lost > 0) {
      auto made = remade(job);
      if (!made) {
        end(job, made.error());
        continue;
      }
      const std::shared_ptr<Job>& suspect = *made;
      parts_.board.add(suspect->record);
      suspect->record->queued();
      suspect->record->set_cancel([weak = weak_from_this(), waiting = std::weak_ptr<Job>(suspect)] {
        const auto recovery = weak.lock();
        const auto strong = waiting.lock();
        if (recovery != nullptr && strong != nullptr) recovery->give_up(strong);
      });
      suspects_.push_back(suspect);
    } else {
      waiting_.push_back(std::move(job));
    }
  }
  parts_.log.info(Component::server, "jobs_taken_up",
                  {{"jobs", static_cast<std::int64_t>(waiting_.size() + suspects_.size())}});
  return {};
}

// Ends a job that waits here; the scheduler ends the jobs that it has.
void Recovery::give_up(const std::shared_ptr<Job>& job) {
  bool waited = false;
  {
    const MutexLock lock(mutex_);
    waited = std::erase(suspects_, job) > 0;
  }
  if (!waited) return parts_.scheduler.cancel(job);
  end(job->record, failure(ErrorCode::cancelled, "given up while the job waited"));
}

void Recovery::admit_suspect() {
  OneSuspect& one = arrays_.one_suspect();
  while (!suspects_.empty() && one.enter(weak_from_this())) {
    const std::shared_ptr<Job> job = suspects_.front();
    if (const auto place = parts_.scheduler.admit(job, weak_from_this()); !place) {
      one.leave();
      if (parts_.scheduler.is_closed() || parts_.scheduler.fits_alone(*job)) return;
      end(job->record, place.error());
    }
    suspects_.pop_front();
  }
}

void Recovery::room() {
  const MutexLock lock(mutex_);
  admit_suspect();
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

// Makes the job as it was, but with its client's current rights and the server's current defaults. Checking
// the request counts as a start: a crash in it would otherwise end every server that starts.
Expected<std::shared_ptr<Job>> Recovery::remade(const StoredJob& stored) {
  store_.began({stored.id, static_cast<int>(stored.lost) + 1});
  auto job = [&]() -> Expected<std::shared_ptr<Job>> {
    try {
      return checked(stored);
    } catch (const std::exception& error) {
      return unexpected(failure(ErrorCode::internal, error.what()));
    }
  }();
  store_.ended(stored.id);
  return job;
}

Expected<std::shared_ptr<Job>> Recovery::checked(const StoredJob& stored) {
  fault_point("take", stored.request_id);
  MARBLE_ASSIGN_OR_RETURN(const auto bytes, store_.request_of(stored.id));
  MARBLE_ASSIGN_OR_RETURN(const auto request, stored_request(bytes));
  const auto highest = static_cast<std::int64_t>(parts_.access.quota_of(stored.client).priority);
  request->set_priority(to_message(priority_of(std::max(stored.priority, highest))));
  const Caller caller{.identity = {.client = stored.client, .roles = {}},
                      .origin = {.peer = stored.peer,
                                 .client = stored.client,
                                 .request_id = stored.request_id,
                                 .trace = parse_traceparent(stored.traceparent, random_id())},
                      .earlier = Caller::Earlier{stored.id, time_of(stored.accepted_unix_s)}};
  MARBLE_ASSIGN_OR_RETURN(auto job, make_job(parts_, caller, JobKind::submitted, request));
  std::function<void()> then;
  if (stored.lost > 0) {
    then = [weak = weak_from_this()] {
      const auto recovery = weak.lock();
      if (recovery == nullptr) return;
      recovery->arrays_.one_suspect().leave();
      recovery->room();
    };
  }
  const auto keeper = std::make_shared<ResultKeeper>(parts_, &store_, job->record,
                                                     static_cast<int>(stored.lost), std::move(then));
  keeper->added();
  job->observer = keeper;
  return job;
}

// The job's result is this error.
void Recovery::end(const StoredJob& stored, const Error& error) const {
  const auto record = parts_.board.make(description_of(stored, {}), Options());
  parts_.board.add(record);
  end(record, error);
}

void Recovery::end(const std::shared_ptr<JobRecord>& record, const Error& error) const {
  record->finished(unexpected(error), 0.0, 0.0);
  parts_.board.finish(record);
  ResultKeeper keeper(parts_, &store_, record);
  keeper.added();
  keeper.finished({.solution = unexpected(error)});
}

}  // namespace marble::server
