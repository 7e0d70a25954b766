#include "submissions/local_submissions.h"

#include "base/wire.h"
#include "jobs/unix_time.h"
#include "service/admission.h"
#include "service/job_access.h"
#include "service/job_requests.h"
#include "store/digest.h"
#include "submissions/result_keeper.h"

namespace marble::server {
namespace {

void fill(const std::string& id, const QueuePlace& place, v1::SubmitResponse* response) {
  response->set_job_id(id);
  response->set_queue_position(place.position);
  response->set_estimated_wait_s(place.estimated_wait_s);
}

// Writes the job to disk. A job that cannot be written ends, and no one has seen it.
OnFinished kept(const ServiceParts& parts, JobStore& store, const std::shared_ptr<ResultKeeper>& keeper,
                const std::shared_ptr<JobRecord>& record, StoredJob job) {
  return [&parts, &store, keeper, record, job = std::move(job)](const CompletionCallback& settled) mutable {
    store.add(std::move(job), [&parts, record, settled](const Expected<void>& added) {
      if (added) return settled(added);
      record->cancel();
      parts.results.forget(record->id());
      parts.board.forget(record->id());
      settled(unexpected(Submissions::not_kept(added.error())));
    });
    keeper->added();
  };
}

}  // namespace

Expected<std::unique_ptr<Submissions>> LocalSubmissions::begin(const ServiceParts& parts, JobStore* store) {
  std::unique_ptr<LocalSubmissions> submissions(new LocalSubmissions(parts, store));
  if (store == nullptr) return submissions;
  MARBLE_ASSIGN_OR_RETURN(submissions->recovery_, Recovery::begin(parts, *submissions->arrays_, *store));
  return submissions;
}

Expected<OnFinished> LocalSubmissions::submit(const Caller& caller, std::shared_ptr<v1::SolveRequest> request,
                                              v1::SubmitResponse* response) {
  if (auto well = health(); !well) return unexpected(not_kept(well.error()));
  MARBLE_ASSIGN_OR_RETURN(const auto job, make_job(parts_, caller, JobKind::submitted, request));
  StoredJob stored{.request_id = request->request_id()};
  if (store_ != nullptr || !stored.request_id.empty()) stored.request = request->SerializeAsString();
  if (!stored.request_id.empty()) stored.digest = digest_of(stored.request);
  ResultStore::Request asked{store_ == nullptr ? request : nullptr, job->ticket.bytes};
  request = nullptr;  // now owned by the job
  const std::shared_ptr<JobRecord> record = job->record;
  const std::string& client = caller.identity.client;
  MARBLE_ASSIGN_OR_RETURN(const auto id,
                          parts_.results.expect(record->id(), client, {stored.request_id, stored.digest}));
  if (id != record->id()) {
    const auto earlier = parts_.board.find(id);
    fill(id, earlier != nullptr ? earlier->place() : QueuePlace{}, response);
    return when_settled();
  }
  if (parts_.config.bundles > 0) parts_.results.keep_request(record->id(), std::move(asked));
  const auto keeper = std::make_shared<ResultKeeper>(parts_, store_, record);
  job->observer = keeper;
  const auto place = parts_.scheduler.admit(job);
  if (!place) {
    parts_.results.forget(record->id());
    return unexpected(place.error());
  }
  fill(record->id(), *place, response);
  if (store_ == nullptr) return OnFinished();
  const JobDescription& what = record->description();
  stored.id = what.id;
  stored.client = client;
  stored.peer = what.peer;
  if (what.trace) stored.traceparent = to_traceparent(*what.trace);
  stored.priority = static_cast<std::int64_t>(what.priority);
  stored.accepted_unix_s = unix_s(what.accepted);
  return kept(parts_, *store_, keeper, record, std::move(stored));
}

Expected<OnFinished> LocalSubmissions::cancel(const Identity& caller, const std::string& id,
                                              v1::CancelJobResponse* response) {
  MARBLE_RETURN_IF_ERROR(cancel_job(parts_.board, caller, id, response));
  const auto record = parts_.board.find(id);
  if (store_ == nullptr || record == nullptr || !outlives_call(record->description().kind))
    return OnFinished();
  store_->cancel(id);
  return when_settled();
}

Expected<OnFinished> LocalSubmissions::remove(const Identity& caller, const std::string& id) {
  const std::string owner = parts_.results.owner(id);
  if (owner.empty() || !may_see(caller, owner)) return unexpected(no_such_job(id));
  if (!may_end(caller, owner)) return unexpected(not_to_end(id));
  if (!parts_.results.forget(id)) return unexpected(no_such_job(id));
  if (const auto record = parts_.board.find(id); record != nullptr) record->cancel();
  parts_.board.forget(id);
  return when_settled();
}

void LocalSubmissions::fetch_pair(const std::string& id, bool finished,
                                  std::function<void(Expected<AskedAndAnswered>)> then) {
  const auto asked = parts_.results.request(id);
  if (!asked) return then(unexpected(no_request(id)));
  AskedAndAnswered both;
  if (asked->message != nullptr) {
    both.request = asked->message->SerializeAsString();
  } else {
    auto request = store_->request_of(id);
    if (!request) return then(unexpected(request.error()));
    both.request = std::move(*request);
  }
  if (!finished) return then(std::move(both));
  // A job that has just finished has its result in a moment.
  const auto shared = std::make_shared<AskedAndAnswered>(std::move(both));
  parts_.results.wait(id, shared.get(), [id, shared, then](const ResultStore::Shared& result) {
    if (result == nullptr) return then(unexpected(no_such_job(id)));
    if (result->answer) shared->answer = bytes_of(*result->answer);
    then(std::move(*shared));
  });
}

void LocalSubmissions::find_array(const std::string& id, std::function<void(Expected<FoundArray>)> then) {
  const auto array = arrays_->find(id);
  if (array == nullptr) return then(unexpected(no_array(id)));
  then(FoundArray{array, array->description().client, array->elements()});
}

Expected<void> LocalSubmissions::health() const {
  return store_ != nullptr ? store_->health() : Expected<void>();
}

std::optional<StoreUsage> LocalSubmissions::usage() const {
  if (store_ == nullptr) return std::nullopt;
  return store_->usage();
}

OnFinished LocalSubmissions::when_settled() const {
  if (store_ == nullptr) return {};
  return [store = store_](CompletionCallback settled) { store->when_settled(std::move(settled)); };
}

}  // namespace marble::server
