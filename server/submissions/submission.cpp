#include "submissions/submission.h"

#include <openssl/sha.h>

#include "jobs/unix_time.h"
#include "messages/job_access.h"
#include "messages/job_requests.h"
#include "submissions/result_keeper.h"

namespace marble::server {
namespace {

std::string digest_of(const std::string& bytes) {
  std::string digest(SHA256_DIGEST_LENGTH, '\0');
  SHA256(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(),
         reinterpret_cast<unsigned char*>(digest.data()));
  return digest;
}

void fill(const std::string& id, const QueuePlace& place, v1::SubmitResponse* response) {
  response->set_job_id(id);
  response->set_queue_position(place.position);
  response->set_estimated_wait_s(place.estimated_wait_s);
}

Error not_kept(const Error& why) {
  return failure(ErrorCode::unavailable, "the server cannot keep a job now: " + why.bound);
}

// The job on disk. One that cannot be put there ends, and nobody has heard of it.
Afterwards kept(const ServiceParts& parts, const std::shared_ptr<ResultKeeper>& keeper,
                const std::shared_ptr<JobRecord>& record, StoredJob job) {
  return [&parts, keeper, record, job = std::move(job)](const Settled& settled) mutable {
    parts.store->add(std::move(job), [&parts, record, settled](const Expected<void>& added) {
      if (added) return settled(added);
      record->cancel();
      parts.results.forget(record->id());
      parts.board.forget(record->id());
      settled(unexpected(not_kept(added.error())));
    });
    keeper->added();
  };
}

}  // namespace

Expected<Afterwards> submit(const ServiceParts& parts, const Caller& caller,
                            std::shared_ptr<v1::SolveRequest> request, v1::SubmitResponse* response) {
  if (parts.store != nullptr) {
    if (auto well = parts.store->health(); !well) return unexpected(not_kept(well.error()));
  }
  const auto job = make_job(parts, caller, JobKind::submitted, request);
  if (!job) return unexpected(job.error());
  StoredJob stored{.request_id = request->request_id()};
  if (parts.store != nullptr || !stored.request_id.empty()) stored.request = request->SerializeAsString();
  if (!stored.request_id.empty()) stored.digest = digest_of(stored.request);
  request = nullptr;  // the job's
  const std::shared_ptr<JobRecord> record = (*job)->record;
  const std::string& client = caller.identity.client;
  const auto id = parts.results.expect(record->id(), client, {stored.request_id, stored.digest});
  if (!id) return unexpected(id.error());
  if (*id != record->id()) {
    const auto earlier = parts.board.find(*id);
    fill(*id, earlier != nullptr ? earlier->place() : QueuePlace{}, response);
    return when_settled(parts);
  }
  const auto keeper = std::make_shared<ResultKeeper>(parts, record);
  (*job)->observer = keeper;
  const auto place = parts.scheduler.admit(*job);
  if (!place) {
    parts.results.forget(record->id());
    return unexpected(place.error());
  }
  fill(record->id(), *place, response);
  if (parts.store == nullptr) return Afterwards();
  const JobDescription& what = record->description();
  stored.id = what.id;
  stored.client = client;
  stored.peer = what.peer;
  if (what.trace) stored.traceparent = to_traceparent(*what.trace);
  stored.priority = static_cast<std::int64_t>(what.priority);
  stored.accepted_unix_s = unix_s(what.accepted);
  return kept(parts, keeper, record, std::move(stored));
}

Expected<Afterwards> cancel_job(const ServiceParts& parts, const Identity& caller, const std::string& id,
                                v1::CancelJobResponse* response) {
  if (auto asked = cancel_job(parts.board, caller, id, response); !asked) return unexpected(asked.error());
  const auto record = parts.board.find(id);
  if (parts.store == nullptr || record == nullptr || record->description().kind != JobKind::submitted)
    return Afterwards();
  parts.store->cancel(id);
  return when_settled(parts);
}

Afterwards when_settled(const ServiceParts& parts) {
  if (parts.store == nullptr) return {};
  return [store = parts.store](Settled settled) { store->when_settled(std::move(settled)); };
}

}  // namespace marble::server
