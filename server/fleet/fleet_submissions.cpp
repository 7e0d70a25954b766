#include "fleet/fleet_submissions.h"

#include <unistd.h>

#include <algorithm>
#include <array>

#include "base/fault_point.h"
#include "base/random_id.h"
#include "base/status.h"
#include "fleet/fleet_draft.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "service/admission.h"
#include "service/job_access.h"
#include "service/job_message.h"
#include "service/job_requests.h"
#include "service/stored_job.h"
#include "store/digest.h"
#include "submissions/result_keeper.h"

namespace marble::server {
namespace {

// "HOST:PORT", or with an id of its own instead of an unspecified port.
std::string name_of(const Config& config) {
  std::array<char, 256> host = {};
  (void)gethostname(host.data(), host.size() - 1);
  const std::string& address = config.listen.front();
  const std::size_t colon = address.rfind(':');
  const std::string port = colon == std::string::npos ? "" : address.substr(colon + 1);
  const bool has_port =
      !port.empty() && port != "0" && port.find_first_not_of("0123456789") == std::string::npos;
  return std::string(host.data()) + ":" + (has_port ? port : random_id().substr(0, 6));
}

FleetLimits limits_of(const ServiceParts& parts) {
  return {.queue = parts.scheduler.limits(),
          .keep_s = parts.config.result_keep_s,
          .answer_bytes = parts.config.result_bytes,
          .keeps_requests = parts.config.bundles > 0,
          .lease_s = parts.config.state_lease_s,
          .job_starts = parts.config.job_starts};
}

Error too_large(const char* what) {
  return failure(ErrorCode::resource_exhausted, what, "is larger than the store takes, 1 GB");
}

}  // namespace

// Looks for the next job when a worker is free.
class FleetSubmissions::Waiter final : public RoomWaiter {
 public:
  explicit Waiter(std::function<void()> look) : look_(std::move(look)) {}
  void room() override { look_(); }

 private:
  const std::function<void()> look_;
};

class FleetSubmissions::Keeper final : public JobObserver {
 public:
  Keeper(FleetSubmissions& submissions, std::shared_ptr<JobRecord> record, std::string token)
      : submissions_(submissions), record_(std::move(record)), token_(std::move(token)) {}
  void finished(Outcome outcome) override { submissions_.ended(*record_, token_, std::move(outcome)); }

 private:
  FleetSubmissions& submissions_;
  const std::shared_ptr<JobRecord> record_;
  const std::string token_;
};

FleetSubmissions::FleetSubmissions(const ServiceParts& parts)
    : parts_(parts),
      server_(name_of(parts.config)),
      room_(std::make_shared<Waiter>([this] { store_.look_for_jobs(); })),
      mirror_(parts, *this),
      store_(parts.config.state, server_, limits_of(parts), parts.log, *this) {
  parts.scheduler.set_room_listener(room_);
  parts.results.set_fetch([this](const std::string& id) { mirror_.fetch(id); });
  mirror_.start();
}

// Running jobs report their end to this object.
FleetSubmissions::~FleetSubmissions() {
  parts_.scheduler.drain(std::chrono::duration<double>(0.0));
  close();
}

Expected<std::unique_ptr<Submissions>> FleetSubmissions::begin(const ServiceParts& parts) {
  auto database = Postgres::open(parts.config.state);
  if (database) {
    MARBLE_RETURN_IF_ERROR(prepare_fleet(*database));
  }
  std::unique_ptr<FleetSubmissions> begun(new FleetSubmissions(parts));
  if (database) begun->mirror_.wait(Postgres::kPatience);  // so that it can serve the existing jobs
  return begun;
}

void FleetSubmissions::close() {
  std::vector<std::pair<std::string, std::string>> arrays;
  {
    const MutexLock lock(mutex_);
    for (const auto& [id, job] : held_) {
      if (job.elements.array != nullptr && !job.record->is_finished()) arrays.emplace_back(id, job.token);
    }
  }
  for (const auto& [id, token] : arrays) left(id, token);  // those that nothing of ran here
  store_.close();
  mirror_.close();
}

Expected<OnFinished> FleetSubmissions::submit(const Caller& caller, std::shared_ptr<v1::SolveRequest> request,
                                              v1::SubmitResponse* response) {
  if (parts_.scheduler.is_closed()) return unexpected(draining());
  if (auto well = health(); !well) return unexpected(not_kept(well.error()));
  const auto job = std::make_shared<FleetJob>();
  job->stored.request = request->SerializeAsString();
  if (job->stored.request.size() > kLargestValue) return unexpected(too_large("problem"));
  job->stored.request_id = request->request_id();
  MARBLE_ASSIGN_OR_RETURN(const auto checked,
                          make_job(parts_, caller, JobKind::submitted, std::move(request)));
  const JobRecord& record = *checked->record;
  const JobDescription& what = record.description();
  if (!job->stored.request_id.empty()) job->stored.digest = digest_of(job->stored.request);
  job->stored.id = what.id;
  job->stored.client = what.client;
  job->stored.peer = what.peer;
  if (what.trace) job->stored.traceparent = to_traceparent(*what.trace);
  job->stored.priority = static_cast<std::int64_t>(what.priority);
  job->quota = checked->quota;
  v1::JobInfo info;
  to_message(record, &info);
  job->info = info.SerializeAsString();
  MARBLE_RETURN_IF_ERROR(check_name(what.client));
  return [this, job, response](const CompletionCallback& settled) {
    store_.add(job, [job, response, settled](const Expected<void>& made) {
      if (!made) return settled(unexpected(not_kept(made.error())));
      if (!job->id) return settled(unexpected(job->id.error()));
      response->set_job_id(utf8(*job->id));
      response->set_queue_position(job->position);
      settled({});
    });
  };
}

Expected<OnFinished> FleetSubmissions::cancel(const Identity& caller, const std::string& id,
                                              v1::CancelJobResponse* response) {
  const auto record = find_job(parts_.board, caller, id);
  if (!record) return unexpected(record.error());
  if (!may_end(caller, (*record)->description().client)) return unexpected(not_to_end(id));
  if (!outlives_call((*record)->description().kind) || (*record)->is_finished()) {
    MARBLE_RETURN_IF_ERROR(cancel_job(parts_.board, caller, id, response));
    return OnFinished();
  }
  // The result if the job still waits: no server runs it, so none writes one.
  const auto ended = parts_.board.make((*record)->description(), (*record)->options());
  Outcome outcome{.solution = unexpected(failure(ErrorCode::cancelled, "given up while the job waited"))};
  const JobSnapshot snapshot = (*record)->snapshot();
  if (snapshot.array) ended->set_array(*snapshot.array, snapshot.result_bytes);
  ended->finished(outcome.solution, 0.0, 0.0);
  StoredResult stored = result_of(*ended, outcome).stored;
  return [this, record = *record, response, stored = std::move(stored)](const CompletionCallback& settled) {
    store_.cancel(stored, [this, record, response, settled](const Expected<void>& made) {
      if (!made) return settled(unexpected(made.error()));
      if (has(record->id())) record->cancel();
      look(record->id(), [record, response, settled](const Expected<void>& /*looked*/) {
        to_message(*record, response->mutable_job());
        settled({});
      });
    });
  };
}

Expected<OnFinished> FleetSubmissions::remove(const Identity& caller, const std::string& id) {
  const std::string owner = parts_.results.owner(id);
  if (owner.empty() || !may_see(caller, owner)) return unexpected(no_such_job(id));
  if (!may_end(caller, owner)) return unexpected(not_to_end(id));
  return [this, id](const CompletionCallback& settled) {
    store_.forget(id, [this, settled](const Expected<void>& made) {
      if (!made) return settled(made);
      look("", settled);
    });
  };
}

// As many as can begin at once. If other jobs, or the elements of an array, keep the workers busy, one more,
// which then waits with them for its turn.
FleetTaker::Room FleetSubmissions::room() {
  if (parts_.scheduler.is_draining()) return {};
  const int free = parts_.scheduler.free_workers();
  const MutexLock lock(mutex_);
  const bool runs_arrays =
      std::ranges::any_of(held_, [](const auto& one) { return one.second.elements.array != nullptr; });
  if (free > 0 || (free == 0 && !runs_arrays)) return {free, !one_suspect_.is_taken()};
  const bool waits = std::ranges::any_of(
      held_, [](const auto& one) { return one.second.record->snapshot().state == JobState::queued; });
  return {waits ? 0 : 1, false};
}

Quota FleetSubmissions::quota_of(const std::string& client) { return parts_.access.quota_of(client); }

void FleetSubmissions::jobs_wait() { store_.look_for_jobs(); }

bool FleetSubmissions::has(const std::string& id) {
  const MutexLock lock(mutex_);
  return held_.contains(id);
}

bool FleetSubmissions::unless_here(const std::string& id, const std::function<void()>& then) {
  const MutexLock lock(mutex_);
  if (held_.contains(id)) return false;
  then();
  return true;
}

std::vector<std::pair<std::string, std::string>> FleetSubmissions::held() {
  const MutexLock lock(mutex_);
  std::vector<std::pair<std::string, std::string>> all;
  for (const auto& [id, job] : held_) {
    if (!job.is_lost) all.emplace_back(id, job.token);
  }
  return all;
}

void FleetSubmissions::lost(const std::vector<std::string>& ids) {
  std::vector<std::shared_ptr<JobRecord>> records;
  std::vector<std::shared_ptr<Array>> arrays;
  {
    const MutexLock lock(mutex_);
    for (const std::string& id : ids) {
      const auto job = held_.find(id);
      if (job == held_.end()) continue;
      job->second.is_lost = true;
      if (job->second.elements.array != nullptr) {
        arrays.push_back(job->second.elements.array);
      } else {
        records.push_back(job->second.record);
      }
    }
  }
  for (const auto& record : records) record->cancel();
  for (const auto& array : arrays) array->abandon();
}

void FleetSubmissions::cancelled(const std::string& id) {
  std::shared_ptr<JobRecord> record;
  {
    const MutexLock lock(mutex_);
    if (const auto job = held_.find(id); job != held_.end()) record = job->second.record;
  }
  if (record != nullptr) record->cancel();
}

std::vector<LiveJob> FleetSubmissions::live() {
  const MutexLock lock(mutex_);
  std::vector<LiveJob> all;
  for (auto& [id, job] : held_) {
    const std::int64_t changes = job.record->changes();
    if (changes == job.changes || job.record->snapshot().state != JobState::running) continue;
    job.changes = changes;
    v1::JobEvent event;
    const ProgressHistory::Rows rows = job.record->read(job.cursor);
    for (const Progress& row : rows.rows) marble::to_message(row, event.add_rows());
    v1::GetJobResponse whole;
    to_message(*job.record, &whole);
    const std::int64_t upto = job.cursor - job.begin;
    all.push_back({.number = job.number,
                   .token = job.token,
                   .first = upto - static_cast<std::int64_t>(rows.rows.size()),
                   .upto = upto,
                   .rows = event.SerializeAsString(),
                   .info = whole.job().SerializeAsString(),
                   .job = whole.SerializeAsString()});
    if (job.elements.array == nullptr) continue;
    all.back().is_array = true;
    all.back().request_bytes = job.elements.elements->request_bytes();
    all.back().answer_bytes = job.elements.array->answer_bytes();
  }
  return all;
}

// An exception ends only the job that caused it. A job that is not even held returns to the store when its
// lease ends.
void FleetSubmissions::took(std::vector<TakenJob> jobs) {
  for (TakenJob& job : jobs) {
    const std::string token = job.token;
    const double age_s = job.age_s;
    const bool is_suspect = job.lost > 0 && job.lost < parts_.config.job_starts;
    if (is_suspect && !one_suspect_.enter(room_)) {  // an element of an array was faster
      store_.release(job.stored.id, token);
      continue;
    }
    std::shared_ptr<JobRecord> record;
    try {
      record = hold(job, is_suspect);
      if (job.stored.elements) {
        take_in_array(job, record);
      } else {
        take_in(std::move(job), record);
      }
    } catch (const std::exception& error) {
      if (record != nullptr) end(record, token, age_s, failure(ErrorCode::internal, error.what()));
      if (record == nullptr && is_suspect) one_suspect_.leave();
    }
  }
}

// The record of a running job is the one on the board, whether or not the mirror has already put it there.
std::shared_ptr<JobRecord> FleetSubmissions::hold(const TakenJob& taken, bool is_suspect) {
  const StoredJob& stored = taken.stored;
  (void)parts_.results.expect(stored.id, stored.client);  // the mirror may not have read it yet
  bool was_suspect = false;                               // an earlier run, which will not report its end
  std::shared_ptr<JobRecord> record;
  {
    const MutexLock lock(mutex_);
    if (const auto earlier = held_.find(stored.id); earlier != held_.end())
      was_suspect = earlier->second.is_suspect;
    record = hold_locked(taken, is_suspect);
  }
  if (was_suspect) one_suspect_.leave();
  return record;
}

std::shared_ptr<JobRecord> FleetSubmissions::hold_locked(const TakenJob& taken, bool is_suspect) {
  const StoredJob& stored = taken.stored;
  auto record = parts_.board.find(stored.id);
  // An earlier run of the job on this server that was lost, and may not have ended yet, keeps its own
  // record.
  if (record == nullptr || record->is_finished() || held_.contains(stored.id)) {
    parts_.board.forget(stored.id);
    JobDescription what = description_of(stored, taken.info);
    what.trace = parse_traceparent(stored.traceparent, random_id());
    record = parts_.board.make(std::move(what), Options());
    parts_.board.add(record);
  }
  record->set_server(server_);
  const std::int64_t begin = record->trace().cursor;
  held_[stored.id] = {.number = taken.number,
                      .token = taken.token,
                      .record = record,
                      .begin = begin,
                      .cursor = begin,
                      .is_suspect = is_suspect};
  return record;
}

void FleetSubmissions::end(const std::shared_ptr<JobRecord>& record, const std::string& token, double age_s,
                           const Error& error) {
  record->finished(unexpected(error), age_s, age_s);
  parts_.board.finish(record);
  ended(*record, token, {.solution = unexpected(error)});
}

void FleetSubmissions::take_in(TakenJob taken, const std::shared_ptr<JobRecord>& record) {
  const StoredJob& stored = taken.stored;
  const auto end_it = [&](const Error& error) { end(record, taken.token, taken.age_s, error); };
  fault_point("take", stored.request_id);
  if (stored.cancelled) return end_it(failure(ErrorCode::cancelled, "given up before it had an answer"));
  if (taken.lost >= parts_.config.job_starts) {
    log_set_aside(parts_.log, stored, taken.lost);
    return end_it(set_aside(taken.lost));
  }
  const auto job = std::make_shared<Job>();
  job->record = record;
  job->quota = quota_of(stored.client);
  const Clock::time_point now = Clock::now();
  job->accepted =
      now - std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(taken.age_s));
  job->ticket = {.client = stored.client,
                 .priority = static_cast<Priority>(stored.priority),
                 .arrival = now,
                 .bytes = static_cast<std::int64_t>(stored.request.size())};
  job->observer = std::make_shared<Keeper>(*this, record, taken.token);
  // The worker reads the request, to keep the store's thread free.
  job->work = [this, record, quota = job->quota, taken_in = std::weak_ptr(job),
               shared = std::make_shared<StoredJob>(std::move(taken.stored))](
                  const SolveControls& controls) -> Expected<Solution> {
    StoredJob& own = *shared;
    MARBLE_ASSIGN_OR_RETURN(const auto request, stored_request(own.request));
    own.request = {};
    const auto highest = static_cast<std::int64_t>(quota.priority);
    request->set_priority(to_message(priority_of(std::max(own.priority, highest))));
    const Caller caller{.identity = {.client = own.client, .roles = {}},
                        .origin = {.peer = own.peer, .client = own.client, .request_id = own.request_id},
                        .earlier = Caller::Earlier{own.id, time_of(own.accepted_unix_s), record}};
    MARBLE_ASSIGN_OR_RETURN(const auto made, make_job(parts_, caller, JobKind::submitted, request));
    fault_point("job", own.request_id);
    auto solved = made->work(controls);
    if (const auto whole = taken_in.lock()) whole->also = std::move(made->also);
    return solved;
  };
  const auto place = parts_.scheduler.admit(job);
  if (place) return;
  job->observer = nullptr;
  if (!parts_.scheduler.is_closed() && !parts_.scheduler.fits_alone(*job)) return end_it(place.error());
  store_.release(record->id(), taken.token);
  erase(record->id(), taken.token);
}

void FleetSubmissions::erase(const std::string& id, const std::string& token) {
  Held erased;
  {
    const MutexLock lock(mutex_);
    const auto job = held_.find(id);
    if (job == held_.end() || job->second.token != token) return;
    erased = std::move(job->second);
    held_.erase(job);
  }
  if (erased.is_suspect) one_suspect_.leave();
}

// The result of a job that this server no longer holds is dropped: the current holder writes it.
void FleetSubmissions::ended(JobRecord& record, const std::string& token, Outcome outcome) {
  const std::string& id = record.id();
  Held job;
  {
    const MutexLock lock(mutex_);
    const auto found = held_.find(id);
    if (found == held_.end() || found->second.token != token) return;
    job = found->second;
  }
  if (job.is_lost) {
    erase(id, token);
    parts_.board.forget(id);
    return mirror_.read_anew(id);
  }
  if (outcome.interrupted) {
    store_.release(id, token);
    return erase(id, token);
  }
  KeptResult kept = result_of(record, outcome);
  const auto size = static_cast<std::int64_t>(kept.stored.answer.size());
  const std::int64_t most = std::min(kLargestValue, parts_.config.result_bytes);
  if (size > most) {
    outcome.solution =
        unexpected(failure(ErrorCode::resource_exhausted, "result_bytes", std::to_string(size),
                           "the answer is larger than all that is kept, " + std::to_string(most) + " bytes"));
    kept = result_of(record, outcome);
  }
  fault_point("before_answer");
  store_.finish(std::move(kept.stored), token, [this, id, token](const Expected<void>& made) {
    if (!made) return;  // it is retried
    erase(id, token);
    look("", [](const Expected<void>& /*looked*/) {});
  });
}

}  // namespace marble::server
