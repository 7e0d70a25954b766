#include "fleet/fleet_store.h"

#include <array>
#include <iterator>
#include <map>

#include "base/random_id.h"
#include "process/fault_point.h"
#include "queue/scheduler.h"

namespace marble::server {
namespace {

using Seconds = std::chrono::seconds;

constexpr std::chrono::milliseconds kTick{250};
constexpr Seconds kJanitor{2};
constexpr int kTries = 5;                   // of a transaction that collided with another
constexpr std::int64_t kAnswerBytes = 512;  // that an answer takes besides its own
constexpr std::int64_t kMostOfALine = 64;   // jobs of one client and priority in one take

constexpr const char* kFinish =
    "WITH done AS (UPDATE marble_jobs SET state = 2, token = '', lease = NULL, ended = clock_timestamp(),"
    " answer_bytes = $3, info = $4, changed = pg_current_xact_id()"
    " WHERE id = $1 AND token = $2 AND state = 1 RETURNING number),"
    " asked AS (DELETE FROM marble_requests r USING done WHERE r.number = done.number),"
    " live AS (DELETE FROM marble_live l USING done WHERE l.number = done.number)"
    " INSERT INTO marble_answers SELECT number, $5::bytea, $6::bytea, $7::bytea FROM done";
constexpr const char* kRelease =
    "WITH back AS (UPDATE marble_jobs SET state = 0, token = '', lease = NULL, server = '',"
    " changed = pg_current_xact_id() WHERE id = $1 AND token = $2 AND state = 1 RETURNING number)"
    " DELETE FROM marble_live l USING back WHERE l.number = back.number";
constexpr const char* kCancel =
    "WITH told AS (UPDATE marble_jobs SET cancelled = true, changed = pg_current_xact_id(),"
    " state = CASE state WHEN 0 THEN 2 ELSE state END,"
    " ended = CASE state WHEN 0 THEN clock_timestamp() ELSE ended END,"
    " info = CASE state WHEN 0 THEN $2 ELSE info END WHERE id = $1 AND state < 2 RETURNING number, state),"
    " asked AS (DELETE FROM marble_requests r USING told WHERE r.number = told.number AND told.state = 2)"
    " INSERT INTO marble_answers SELECT number, ''::bytea, $3::bytea, $4::bytea FROM told WHERE state = 2";
constexpr const char* kForget =
    "WITH gone AS (UPDATE marble_jobs SET state = 3, cancelled = true, ended = clock_timestamp(),"
    " changed = pg_current_xact_id() WHERE id = $1 AND state < 3 RETURNING number),"
    " asked AS (DELETE FROM marble_requests r USING gone WHERE r.number = gone.number),"
    " live AS (DELETE FROM marble_live l USING gone WHERE l.number = gone.number)"
    " DELETE FROM marble_answers a USING gone WHERE a.number = gone.number";
constexpr const char* kRenew =
    "UPDATE marble_jobs SET lease = clock_timestamp() + make_interval(secs => $2)"
    " WHERE state = 1 AND token = ANY ($1::text[]) RETURNING id, cancelled";
constexpr const char* kLive =
    "INSERT INTO marble_live SELECT number, $3::bigint, $4::bigint, $5::bytea, $6::bytea, $7::bytea FROM "
    "marble_jobs"
    " WHERE number = $1 AND token = $2 AND state = 1"
    " ON CONFLICT (number) DO UPDATE SET first = excluded.first, upto = excluded.upto, rows = excluded.rows,"
    " info = excluded.info, job = excluded.job";
constexpr const char* kTakeOver =
    "WITH late AS (SELECT number FROM marble_jobs WHERE state = 1 AND lease < clock_timestamp()"
    " ORDER BY number FOR UPDATE SKIP LOCKED),"
    " back AS (UPDATE marble_jobs j SET state = 0, token = '', lease = NULL, lost = lost + 1,"
    " changed = pg_current_xact_id() FROM late WHERE j.number = late.number RETURNING j.number, id, server),"
    " live AS (DELETE FROM marble_live l USING back WHERE l.number = back.number)"
    " SELECT id, server FROM back";
constexpr const char* kLines =
    "SELECT l.client, l.priority, waiting, running, bytes, coalesce(turn, 0) FROM ("
    "SELECT client, priority, count(*) FILTER (WHERE state = 0) AS waiting,"
    " count(*) FILTER (WHERE state = 1) AS running, sum(bytes)::bigint AS bytes"
    " FROM marble_jobs WHERE state < 2 GROUP BY client, priority) l"
    " LEFT JOIN marble_turns t ON t.client = l.client AND t.priority = l.priority";
constexpr const char* kAdd =
    "WITH job AS (INSERT INTO marble_jobs"
    " (id, client, request_id, digest, peer, traceparent, priority, bytes, info)"
    " VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9) RETURNING number)"
    " INSERT INTO marble_requests SELECT number, $10::bytea FROM job";
constexpr const char* kTake =
    "WITH chosen AS (SELECT number FROM marble_jobs WHERE state = 0 AND client = $1 AND priority = $2"
    " ORDER BY number LIMIT $3 FOR UPDATE SKIP LOCKED),"
    " took AS (UPDATE marble_jobs j SET state = 1, server = $4, token = $5::text || j.number::text,"
    " lease = clock_timestamp() + make_interval(secs => $6), changed = pg_current_xact_id()"
    " FROM chosen WHERE j.number = chosen.number RETURNING j.*)"
    " SELECT took.number, id, client, request_id, peer, traceparent, priority,"
    " extract(epoch FROM accepted)::float8, extract(epoch FROM clock_timestamp() - accepted)::float8,"
    " cancelled, lost, token, info, request FROM took JOIN marble_requests USING (number) ORDER BY number";
constexpr const char* kTurn =
    "INSERT INTO marble_turns VALUES ($1, $2, nextval('marble_turn'))"
    " ON CONFLICT (client, priority) DO UPDATE SET turn = excluded.turn";

bool collided(const std::string& state) { return state.starts_with("40"); }

std::string array_of(const std::vector<std::pair<std::string, std::string>>& held) {
  std::string text = "{";
  for (const auto& [id, token] : held) text += (text.size() > 1 ? "," : "") + token;
  return text + "}";
}

void append(std::vector<PgStatement>& all, PgStatement&& one) { all.push_back(std::move(one)); }

}  // namespace

FleetStore::FleetStore(std::string uri, std::string server, const FleetLimits& limits, const Log& log,
                       FleetTaker& taker)
    : uri_(std::move(uri)),
      server_(std::move(server)),
      instance_(random_id()),
      limits_(limits),
      log_(log),
      taker_(taker),
      passed_over_(limits.queue.passed_over, limits.queue.passed_over_time),
      changes_(
          log, [this](std::vector<Change>& changes) { return write(changes); }, kTick) {}

void FleetStore::add(std::shared_ptr<FleetJob> job, Settled settled) {
  looks_ = true;
  changes_.ask({.kind = Kind::add, .job = std::move(job), .settled = std::move(settled)});
}

void FleetStore::finish(StoredResult result, const std::string& token, Settled settled) {
  changes_.ask(
      {.kind = Kind::finish, .result = std::move(result), .token = token, .settled = std::move(settled)});
}

void FleetStore::release(const std::string& id, const std::string& token) {
  changes_.ask({.kind = Kind::release, .result = {.id = id}, .token = token});
}

void FleetStore::cancel(StoredResult if_waiting, Settled settled) {
  changes_.ask({.kind = Kind::cancel, .result = std::move(if_waiting), .settled = std::move(settled)});
}

void FleetStore::forget(const std::string& id, Settled settled) {
  changes_.ask({.kind = Kind::forget, .result = {.id = id}, .settled = std::move(settled)});
}

void FleetStore::look_for_jobs() {
  looks_ = true;
  changes_.wake();
}

StoreUsage FleetStore::usage() const {
  StoreUsage usage = changes_.usage();
  usage.bytes = bytes_;
  return usage;
}

Expected<void> FleetStore::connect() {
  if (database_ && database_->is_open()) return {};
  auto opened = Postgres::open(uri_);
  if (!opened) return unexpected(opened.error());
  if (auto ready = prepare_fleet(*opened); !ready) return ready;
  database_ = std::move(*opened);
  connected_ = std::chrono::steady_clock::now();
  looks_ = true;
  return {};
}

// What collided with another server's transaction was undone, and is tried at once.
Expected<void> FleetStore::write(std::vector<Change>& changes) {
  if (auto connected = connect(); !connected) return connected;
  const auto now = std::chrono::steady_clock::now();
  const Due due{.second = now - second_ >= Seconds(1), .janitor = now - janitor_ >= kJanitor};
  Expected<void> written;
  for (int i = 0; i < kTries; ++i) {
    written = write_once(changes, due);
    if (written) break;
    if (database_->is_open()) (void)database_->run("ROLLBACK");
    if (!collided(database_->state())) break;
  }
  if (written && due.second) second_ = now;
  if (written && due.janitor) janitor_ = now;
  return written;
}

Expected<void> FleetStore::write_once(std::vector<Change>& changes, const Due& due) {
  if (auto renewed = renew(); !renewed) return renewed;
  const bool looks = looks_.exchange(false) || due.second;
  const int room = looks ? taker_.room() : 0;
  if (changes.empty() && room <= 0 && !due.second) return {};
  std::vector<PgStatement> first;
  first.emplace_back("BEGIN");
  bool adds = false;
  for (const Change& change : changes) {
    const StoredResult& result = change.result;
    switch (change.kind) {
      case Kind::add:
        adds = true;
        break;
      case Kind::finish:
        append(first, PgStatement(kFinish)
                          .text(result.id)
                          .text(change.token)
                          .number(static_cast<std::int64_t>(result.answer.size()) + kAnswerBytes)
                          .blob(result.info)
                          .blob(result.answer)
                          .blob(result.error)
                          .blob(result.job));
        break;
      case Kind::release:
        append(first, PgStatement(kRelease).text(result.id).text(change.token));
        break;
      case Kind::cancel:
        append(first,
               PgStatement(kCancel).text(result.id).blob(result.info).blob(result.error).blob(result.job));
        break;
      case Kind::forget:
        append(first, PgStatement(kForget).text(result.id));
        break;
    }
  }
  // After a pause of the network or the database all have a lease's time to say that they are there.
  const bool takes_over =
      due.second &&
      std::chrono::duration<double>(std::chrono::steady_clock::now() - connected_).count() > limits_.lease_s;
  if (takes_over) first.emplace_back(kTakeOver);
  if (adds) first.emplace_back("SELECT pg_advisory_xact_lock(hashtext('marble_jobs'))");
  const auto begun = database_->run(first);
  if (!begun) return unexpected(begun.error());
  bool tells = !changes.empty();
  if (takes_over) {
    const PgRows& late = (*begun)[first.size() - (adds ? 2 : 1)];
    for (int row = 0; row < late.size(); ++row) {
      tells = true;
      log_.warn(Component::server, "job_taken_over",
                {{"job", std::string(late.bytes(row, 0))}, {"from", std::string(late.bytes(row, 1))}});
    }
  }
  std::vector<TakenJob> taken;
  if (adds || room > 0) {
    auto now = lines();
    if (!now) return unexpected(now.error());
    if (adds) {
      if (auto added = add_all(changes, *now); !added) return added;
    }
    if (room > 0) {
      auto took = take(*now, room);
      if (!took) return unexpected(took.error());
      taken = std::move(*took);
      tells = tells || !taken.empty();
    }
  }
  if (due.janitor) {
    if (auto cleaned = clean(); !cleaned) return cleaned;
  }
  std::vector<PgStatement> last;
  if (tells) last.emplace_back(kFleetNotify);
  last.emplace_back("COMMIT");
  if (tells) fault_point("before_commit");
  if (auto ended = database_->run(last); !ended) return unexpected(ended.error());
  if (tells) fault_point("after_commit");
  if (!taken.empty()) taker_.took(std::move(taken));
  return {};
}

// In a transaction that waits for no disk: what it says is soon said again.
Expected<void> FleetStore::renew() {
  const auto held = taker_.held();
  if (held.empty()) return {};
  std::vector<PgStatement> all;
  all.emplace_back("BEGIN");
  all.emplace_back("SET LOCAL synchronous_commit = off");
  append(all, PgStatement(kRenew).text(array_of(held)).real(limits_.lease_s));
  for (const LiveJob& job : taker_.live())
    append(all, PgStatement(kLive)
                    .number(job.number)
                    .text(job.token)
                    .number(job.first)
                    .number(job.upto)
                    .blob(job.rows)
                    .blob(job.info)
                    .blob(job.job));
  all.emplace_back("COMMIT");
  const auto renewed = database_->run(all);
  if (!renewed) return unexpected(renewed.error());
  const PgRows& ours = (*renewed)[2];
  for (int row = 0; row < ours.size(); ++row) {
    if (ours.truth(row, 1)) taker_.cancelled(std::string(ours.bytes(row, 0)));
  }
  if (static_cast<std::size_t>(ours.size()) == held.size()) return {};
  std::vector<std::string> lost;
  for (const auto& [id, token] : held) {
    bool is_ours = false;
    for (int row = 0; row < ours.size(); ++row) is_ours = is_ours || ours.bytes(row, 0) == id;
    if (!is_ours) lost.push_back(id);
  }
  taker_.lost(lost);
  return {};
}

Expected<FleetStore::Lines> FleetStore::lines() {
  const auto rows = database_->run(kLines);
  if (!rows) return unexpected(rows.error());
  Lines lines;
  for (int row = 0; row < rows->size(); ++row) {
    lines.push_back({.client = std::string(rows->bytes(row, 0)),
                     .priority = static_cast<std::size_t>(rows->integer(row, 1)),
                     .waiting = rows->integer(row, 2),
                     .running = rows->integer(row, 3),
                     .bytes = rows->integer(row, 4),
                     .turn = rows->integer(row, 5)});
  }
  return lines;
}

// The rules of JobQueue::push(), for all servers together.
QueueRefusal FleetStore::refusal(const FleetJob& job, const Lines& lines, int& position) const {
  const auto priority = static_cast<std::size_t>(job.stored.priority);
  Line all, own;
  std::int64_t before = 0;
  for (const Line& line : lines) {
    for (Line* sum : {&all, &own}) {
      if (sum == &own && line.client != job.stored.client) continue;
      sum->waiting += line.waiting;
      sum->running += line.running;
      sum->bytes += line.bytes;
    }
    if (line.priority <= priority) before += line.waiting;
  }
  position = static_cast<int>(before);
  const QueueLimits& most = limits_.queue;
  const auto bytes = static_cast<std::int64_t>(job.stored.request.size());
  if (all.waiting >= most.jobs_for(static_cast<Priority>(priority)) + most.workers) return QueueRefusal::jobs;
  const bool runs_at_once = own.waiting == 0 && own.running < job.quota.running;
  if (own.waiting >= job.quota.queued && !runs_at_once) return QueueRefusal::client_jobs;
  if (bytes > most.bytes - all.bytes) return QueueRefusal::bytes;
  if (bytes > job.quota.bytes - own.bytes) return QueueRefusal::client_bytes;
  return QueueRefusal::none;
}

Expected<void> FleetStore::add_all(std::vector<Change>& changes, Lines& lines) {
  std::vector<PgStatement> ask, add;
  for (const Change& change : changes) {
    if (change.kind != Kind::add) continue;
    const StoredJob& job = change.job->stored;
    append(ask, PgStatement("SELECT id, digest FROM marble_jobs"
                            " WHERE client = $1 AND request_id = $2 AND request_id <> '' AND state < 3")
                    .text(job.client)
                    .text(job.request_id));
  }
  const auto earlier = database_->run(ask);
  if (!earlier) return unexpected(earlier.error());
  struct Earlier {
    std::string id, digest;
  };
  std::map<std::pair<std::string, std::string>, Earlier> of_group;
  std::size_t at = 0;
  for (const Change& change : changes) {
    if (change.kind != Kind::add) continue;
    const PgRows& rows = (*earlier)[at++];
    FleetJob& job = *change.job;
    const StoredJob& stored = job.stored;
    const std::pair name(stored.client, stored.request_id);
    if (rows.size() > 0) of_group[name] = {std::string(rows.bytes(0, 0)), std::string(rows.bytes(0, 1))};
    if (const auto same = of_group.find(name); same != of_group.end() && !stored.request_id.empty()) {
      job.id = same->second.id;
      if (same->second.digest != stored.digest)
        job.id =
            unexpected(invalid("request_id", stored.request_id,
                               "must be new: job " + same->second.id + " is of another request by this id"));
      continue;
    }
    if (const auto why = refusal(job, lines, job.position); why != QueueRefusal::none) {
      const Ticket ticket{.client = stored.client,
                          .priority = static_cast<Priority>(stored.priority),
                          .bytes = static_cast<std::int64_t>(stored.request.size())};
      job.id = unexpected(refusal_of(why, limits_.queue, ticket, job.quota));
      continue;
    }
    job.id = stored.id;
    of_group[name] = {stored.id, stored.digest};
    const auto bytes = static_cast<std::int64_t>(stored.request.size());
    const auto priority = static_cast<std::size_t>(stored.priority);
    auto line = std::ranges::find_if(
        lines, [&](const Line& one) { return one.client == stored.client && one.priority == priority; });
    if (line == lines.end()) line = lines.insert(line, {.client = stored.client, .priority = priority});
    ++line->waiting;
    line->bytes += bytes;
    append(add, PgStatement(kAdd)
                    .text(stored.id)
                    .text(stored.client)
                    .text(stored.request_id)
                    .blob(stored.digest)
                    .text(stored.peer)
                    .text(stored.traceparent)
                    .number(stored.priority)
                    .number(bytes)
                    .blob(job.info)
                    .blob(stored.request));
  }
  if (add.empty()) return {};
  const auto added = database_->run(add);
  return added ? Expected<void>() : unexpected(added.error());
}

// The rules of JobQueue::pop(): priorities with those that were passed over, then clients in turns, within
// their quotas.
Expected<std::vector<TakenJob>> FleetStore::take(const Lines& lines, int room) {
  std::map<std::string, std::int64_t> running;
  for (const Line& line : lines) running[line.client] += line.running;
  std::array<std::vector<Line>, kPriorities> able;
  for (const Line& line : lines) {
    if (line.waiting > 0 && line.priority < kPriorities) able[line.priority].push_back(line);
  }
  for (auto& turns : able) std::ranges::stable_sort(turns, {}, &Line::turn);
  std::map<std::pair<std::string, std::size_t>, std::int64_t> counts;  // in the order of its locks
  const auto now = std::chrono::steady_clock::now();
  for (int i = 0; i < room; ++i) {
    std::array<std::vector<Line>::iterator, kPriorities> next;
    std::array<bool, kPriorities> has = {};
    for (std::size_t at = 0; at < kPriorities; ++at) {
      next[at] = std::ranges::find_if(able[at], [&](const Line& line) {
        return line.waiting > 0 && running[line.client] < taker_.quota_of(line.client).running;
      });
      has[at] = next[at] != able[at].end();
    }
    const std::size_t at = passed_over_.choose(has, now);
    if (at == kPriorities) break;
    --next[at]->waiting;
    ++running[next[at]->client];
    ++counts[{next[at]->client, at}];
    std::rotate(next[at], next[at] + 1, able[at].end());
  }
  std::vector<TakenJob> taken;
  if (counts.empty()) return taken;
  const std::string token = instance_ + "." + std::to_string(++takes_) + ".";
  std::vector<PgStatement> all;
  for (const auto& [line, count] : counts)
    append(all, PgStatement(kTake)
                    .text(line.first)
                    .number(static_cast<std::int64_t>(line.second))
                    .number(std::min(count, kMostOfALine))
                    .text(server_)
                    .text(token)
                    .real(limits_.lease_s));
  for (const auto& [line, count] : counts)
    append(all, PgStatement(kTurn).text(line.first).number(static_cast<std::int64_t>(line.second)));
  const auto took = database_->run(all);
  if (!took) return unexpected(took.error());
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const PgRows& rows = (*took)[i];
    const auto text = [&](int row, int column) { return std::string(rows.bytes(row, column)); };
    for (int row = 0; row < rows.size(); ++row) {
      taken.push_back({.stored = {.id = text(row, 1),
                                  .client = text(row, 2),
                                  .request_id = text(row, 3),
                                  .peer = text(row, 4),
                                  .traceparent = text(row, 5),
                                  .priority = rows.integer(row, 6),
                                  .accepted_unix_s = rows.real(row, 7),
                                  .cancelled = rows.truth(row, 9),
                                  .request = text(row, 13)},
                       .number = rows.integer(row, 0),
                       .age_s = rows.real(row, 8),
                       .lost = static_cast<int>(rows.integer(row, 10)),
                       .token = text(row, 11),
                       .info = text(row, 12)});
    }
  }
  return taken;
}

// What was kept long enough, or is too much; one server at a time.
Expected<void> FleetStore::clean() {
  const auto first = database_->run("SELECT pg_try_advisory_xact_lock(hashtext('marble_clean'))");
  if (!first) return unexpected(first.error());
  if (!first->truth(0, 0)) return {};
  std::vector<PgStatement> all;
  append(all, PgStatement("UPDATE marble_jobs SET state = 3, ended = clock_timestamp(),"
                          " changed = pg_current_xact_id()"
                          " WHERE state = 2 AND ended < clock_timestamp() - make_interval(secs => $1)")
                  .real(limits_.keep_s));
  append(all, PgStatement("UPDATE marble_jobs SET state = 3, ended = clock_timestamp(),"
                          " changed = pg_current_xact_id() WHERE number IN (SELECT number FROM ("
                          "SELECT number, sum(answer_bytes) OVER (ORDER BY ended DESC, number DESC) AS upto"
                          " FROM marble_jobs WHERE state = 2) kept WHERE upto > $1)")
                  .number(limits_.answer_bytes));
  all.emplace_back(
      "DELETE FROM marble_answers USING marble_jobs j WHERE j.state = 3"
      " AND marble_answers.number = j.number");
  all.emplace_back(
      "DELETE FROM marble_jobs WHERE state = 3 AND ended < clock_timestamp() - interval '10 min'");
  all.emplace_back(
      "SELECT sum(pg_total_relation_size(c.oid))::bigint FROM pg_class c"
      " WHERE c.relkind = 'r' AND c.relname LIKE 'marble\\_%'"
      " AND pg_table_is_visible(c.oid)");
  const auto cleaned = database_->run(all);
  if (!cleaned) return unexpected(cleaned.error());
  bytes_ = cleaned->back().integer(0, 0);
  return {};
}

}  // namespace marble::server
