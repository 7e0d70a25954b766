#include "submissions/result_keeper.h"

#include "base/fault_point.h"
#include "base/status.h"
#include "base/wire.h"
#include "service/job_message.h"
#include "service/reply.h"

namespace marble::server {
namespace {

void put(ResultStore& results, JobRecord& record, ResultStore::Result result) {
  if (!results.put(record.id(), std::move(result), Clock::now())) record.set_result_bytes(0);
}

StoredResult stored(const JobRecord& record, const ResultStore::Result& result) {
  StoredResult stored{.id = record.id()};
  v1::GetJobResponse job;
  to_message(record, &job);
  stored.job = job.SerializeAsString();
  stored.info = job.job().SerializeAsString();
  stored.finished_unix_s = job.job().finished_unix_s();
  if (result.answer) {
    stored.answer = bytes_of(*result.answer);
  } else {
    stored.error = to_message(result.answer.error(), result.retry_delay_s).SerializeAsString();
  }
  return stored;
}

}  // namespace

KeptResult result_of(JobRecord& record, const Outcome& outcome) {
  v1::SolveResponse response;
  ResultStore::Result result{unexpected(Error{}), outcome.retry_delay_s};
  if (const auto filled = fill_response(record, outcome, &response); filled) {
    result.answer = serialize(response);
  } else {
    result.answer = unexpected(filled.error());
  }
  const auto bytes = result.answer ? static_cast<std::int64_t>(result.answer->Length()) : 0;
  record.set_result_bytes(bytes);  // before the waiting clients are notified
  return {stored(record, result), std::move(result)};
}

void ResultKeeper::started(double /*queue_s*/) {
  if (store_ == nullptr) return;
  store_->began({record_->id(), lost_ + 1});
  fault_point("job", record_->description().request_id);
}

void ResultKeeper::finished(Outcome outcome) {
  keep_or_wait(std::move(outcome));
  if (then_) then_();
}

void ResultKeeper::keep_or_wait(Outcome outcome) {
  const bool interrupted = outcome.interrupted && store_ != nullptr;
  if (interrupted) outcome.solution = unexpected(draining("the job begins again when it is back"));
  KeptResult answer = result_of(*record_, outcome);
  if (store_ != nullptr) store_->ended(record_->id());
  answer.stored.keeps_request = parts_.config.bundles > 0;
  if (store_ == nullptr || interrupted) return put(parts_.results, *record_, std::move(answer.result));
  {
    const MutexLock lock(mutex_);
    if (!added_) {
      early_ = std::move(answer);
      return;
    }
  }
  keep(std::move(answer));
}

void ResultKeeper::added() {
  std::optional<KeptResult> early;
  {
    const MutexLock lock(mutex_);
    added_ = true;
    early.swap(early_);
  }
  if (early) keep(std::move(*early));
}

// Waiting clients get it once it is on disk; if writing fails, from memory.
void ResultKeeper::keep(KeptResult answer) const {
  fault_point("before_answer");
  store_->finish(std::move(answer.stored),
                 [&results = parts_.results, record = record_, result = std::move(answer.result)](
                     const Expected<void>&) { put(results, *record, result); });
}

}  // namespace marble::server
