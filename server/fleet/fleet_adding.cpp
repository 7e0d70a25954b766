// FleetStore: admitting jobs and arrays, under the lock of all servers.
#include <map>

#include "fleet/fleet_array_statements.h"
#include "fleet/fleet_statements.h"
#include "fleet/fleet_store.h"
#include "jobs/scheduler.h"
#include "store/array_source.h"

namespace marble::server {

// The additions of one transaction. The statements are made in the order of the changes.
class FleetStore::Adding {
 public:
  Adding(const FleetLimits& limits, Lines& lines) : limits_(limits), lines_(lines) {}

  // `earlier`: the row of the client's job by this request id, if there is one.
  void take(const Change& change, const PgRows& earlier);
  void add_element(const Change& change);
  // Has the elements' bytes counted. To be called last.
  [[nodiscard]] std::vector<PgStatement>& statements();
  // Reads what the statements returned.
  void settle(const std::vector<PgRows>& rows) const;

 private:
  struct Earlier {
    std::string id, digest;
  };
  using Name = std::pair<std::string, std::string>;
  [[nodiscard]] QueueRefusal refusal(const FleetJob& job, int& position) const;
  [[nodiscard]] QueueRefusal bytes_refusal(const FleetJob& job, std::int64_t bytes) const;
  [[nodiscard]] Error refused(const FleetJob& job, QueueRefusal why, std::int64_t bytes) const;
  void sum(const FleetJob& job, Line& all, Line& own, std::int64_t& before) const;
  [[nodiscard]] Line& line_of(const FleetJob& job);
  void add(const FleetJob& job);

  const FleetLimits& limits_;
  Lines& lines_;
  std::vector<PgStatement> statements_;
  std::map<Name, Earlier> of_group_;                       // jobs of this transaction too
  std::map<std::string, std::int64_t> bytes_;              // of elements, by array
  std::vector<std::pair<FleetJob*, std::size_t>> sealed_;  // and their statements
};

void FleetStore::Adding::sum(const FleetJob& job, Line& all, Line& own, std::int64_t& before) const {
  for (const Line& line : lines_) {
    for (Line* sum : {&all, &own}) {
      if (sum == &own && line.client != job.stored.client) continue;
      sum->waiting += line.waiting + line.drafts;
      sum->running += line.running;
      sum->bytes += line.bytes;
    }
    if (line.priority <= static_cast<std::size_t>(job.stored.priority)) before += line.waiting;
  }
}

// The rules of JobQueue::push(), for all servers together.
QueueRefusal FleetStore::Adding::refusal(const FleetJob& job, int& position) const {
  const auto priority = static_cast<Priority>(job.stored.priority);
  Line all, own;
  std::int64_t before = 0;
  sum(job, all, own, before);
  position = static_cast<int>(before);
  const QueueLimits& most = limits_.queue;
  if (all.waiting >= most.jobs_for(priority) + most.workers) return QueueRefusal::jobs;
  const bool runs_at_once = own.waiting == 0 && own.running < job.quota.running;
  if (own.waiting >= job.quota.queued && !runs_at_once) return QueueRefusal::client_jobs;
  return bytes_refusal(job, static_cast<std::int64_t>(job.stored.request.size()));
}

QueueRefusal FleetStore::Adding::bytes_refusal(const FleetJob& job, std::int64_t bytes) const {
  Line all, own;
  std::int64_t before = 0;
  sum(job, all, own, before);
  if (bytes > limits_.queue.bytes - all.bytes) return QueueRefusal::bytes;
  if (bytes > job.quota.bytes - own.bytes) return QueueRefusal::client_bytes;
  return QueueRefusal::none;
}

Error FleetStore::Adding::refused(const FleetJob& job, QueueRefusal why, std::int64_t bytes) const {
  const Ticket ticket{
      .client = job.stored.client, .priority = static_cast<Priority>(job.stored.priority), .bytes = bytes};
  return refusal_of(why, limits_.queue, ticket, job.quota);
}

FleetStore::Line& FleetStore::Adding::line_of(const FleetJob& job) {
  const auto priority = static_cast<std::size_t>(job.stored.priority);
  auto line = std::ranges::find_if(lines_, [&](const Line& one) {
    return one.client == job.stored.client && one.priority == priority && !one.suspect;
  });
  if (line == lines_.end()) line = lines_.insert(line, {.client = job.stored.client, .priority = priority});
  return *line;
}

void FleetStore::Adding::add(const FleetJob& job) {
  const StoredJob& stored = job.stored;
  const auto bytes = static_cast<std::int64_t>(stored.request.size());
  const bool is_array = stored.elements.has_value();
  Line& line = line_of(job);
  ++(is_array ? line.drafts : line.waiting);
  line.bytes += bytes;
  PgStatement statement = PgStatement(is_array ? kOpenArray : kAdd)
                              .text(stored.id)
                              .text(stored.client)
                              .text(stored.request_id)
                              .blob(stored.digest)
                              .text(stored.peer)
                              .text(stored.traceparent)
                              .number(stored.priority)
                              .number(bytes)
                              .blob(job.info)
                              .blob(stored.request);
  if (is_array) (void)std::move(statement).text(job.token).real(limits_.lease_s);
  statements_.push_back(std::move(statement));
}

void FleetStore::Adding::take(const Change& change, const PgRows& earlier) {
  FleetJob& job = *change.job;
  const StoredJob& stored = job.stored;
  const bool seals = change.kind == Kind::seal;
  const std::string& digest = seals ? change.result.digest : stored.digest;  // an array's is known at its end
  if (seals && !job.id) return;
  const Name name(stored.client, stored.request_id);
  if (earlier.size() > 0)
    of_group_[name] = {std::string(earlier.bytes(0, 0)), std::string(earlier.bytes(0, 1))};
  if (const auto same = of_group_.find(name); same != of_group_.end() && !stored.request_id.empty()) {
    job.id = same->second.id;
    if (change.kind != Kind::open && same->second.digest != digest)
      job.id =
          unexpected(invalid("request_id", stored.request_id,
                             "must be new: job " + same->second.id + " is of another request by this id"));
    return;
  }
  if (seals && *job.id != stored.id) {
    job.id = unexpected(array_dropped());
    return;
  }
  if (seals) {
    sealed_.emplace_back(&job, statements_.size());
    statements_.push_back(PgStatement(kSealArray)
                              .text(stored.id)
                              .text(job.token)
                              .number(change.result.elements.value_or(0))
                              .blob(digest)
                              .blob(change.result.info));
    of_group_[name] = {stored.id, digest};
    Line& line = line_of(job);
    --line.drafts;
    ++line.waiting;
    return;
  }
  if (const auto why = refusal(job, job.position); why != QueueRefusal::none) {
    job.id = unexpected(refused(job, why, static_cast<std::int64_t>(stored.request.size())));
    return;
  }
  job.id = stored.id;
  if (change.kind == Kind::add) of_group_[name] = {stored.id, digest};
  add(job);
}

void FleetStore::Adding::add_element(const Change& change) {
  FleetJob& job = *change.job;
  const StoredJob& stored = job.stored;
  if (!job.id || *job.id != stored.id) return;
  const auto bytes = static_cast<std::int64_t>(change.element.request.size());
  if (const auto why = bytes_refusal(job, bytes); why != QueueRefusal::none) {
    job.id = unexpected(refused(job, why, bytes));
    return;
  }
  line_of(job).bytes += bytes;
  bytes_[stored.id] += bytes;
  statements_.push_back(PgStatement(kAddElement)
                            .text(stored.id)
                            .text(job.token)
                            .number(change.element.index)
                            .blob(change.element.request));
}

std::vector<PgStatement>& FleetStore::Adding::statements() {
  for (const auto& [id, bytes] : bytes_) statements_.push_back(PgStatement(kAddBytes).text(id).number(bytes));
  return statements_;
}

void FleetStore::Adding::settle(const std::vector<PgRows>& rows) const {
  for (const auto& [job, statement] : sealed_) {
    if (rows[statement].size() == 0)
      job->id =
          unexpected(failure(ErrorCode::unavailable, "not all elements could be written: send it again"));
  }
}

Expected<void> FleetStore::add_all(std::vector<Change>& changes, Lines& lines) {
  std::vector<PgStatement> ask;
  for (const Change& change : changes) {
    if (!change.names_job()) continue;
    ask.push_back(PgStatement("SELECT id, digest FROM marble_jobs"
                              " WHERE client = $1 AND request_id = $2 AND request_id <> '' AND state < 3")
                      .text(change.job->stored.client)
                      .text(change.job->stored.request_id));
  }
  Expected<std::vector<PgRows>> earlier = std::vector<PgRows>();
  if (!ask.empty()) earlier = database_->run(ask);
  if (!earlier) return unexpected(earlier.error());
  Adding adding(limits_, lines);
  std::size_t at = 0;
  for (const Change& change : changes) {
    if (change.names_job()) adding.take(change, (*earlier)[at++]);
    if (change.kind == Kind::add_element) adding.add_element(change);
  }
  const std::vector<PgStatement>& add = adding.statements();
  if (add.empty()) return {};
  MARBLE_ASSIGN_OR_RETURN(const auto added, database_->run(add));
  adding.settle(added);
  for (const Change& change : changes) {
    if (change.kind == Kind::open && change.job->id && *change.job->id == change.job->stored.id)
      drafts_[change.job->stored.id] = change.job->token;
    if (change.kind == Kind::seal) drafts_.erase(change.job->stored.id);
  }
  return {};
}

}  // namespace marble::server
