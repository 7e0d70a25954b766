#include "fleet/fleet_store.h"

#include <array>
#include <iterator>
#include <map>
#include <tuple>

#include "base/random_id.h"
#include "fleet/fleet_statements.h"
#include "jobs/scheduler.h"
#include "process/fault_point.h"

namespace marble::server {
namespace {

using Seconds = std::chrono::seconds;

constexpr std::chrono::milliseconds kTick{250};
constexpr Seconds kGarbageCollector{2};
constexpr int kTries = 5;                   // attempts of a transaction that conflicted with another
constexpr std::int64_t kAnswerBytes = 512;  // memory of a result besides its message
constexpr double kOldest = 4e9;             // limit on a job's age in seconds: clocks count no further
constexpr std::int64_t kMostLost = 1'000'000;
constexpr std::int64_t kMostOfALine = 64;  // jobs of one client and priority in one take

bool collided(const std::string& state) { return state.starts_with("40"); }

std::string tokens_of(const std::vector<std::pair<std::string, std::string>>& held) {
  std::vector<std::string> tokens;
  for (const auto& [id, token] : held) tokens.push_back(token);
  return text_array(tokens);
}

void append(std::vector<PgStatement>& all, PgStatement&& one) { all.push_back(std::move(one)); }

}  // namespace

TakenJob taken_in(const PgRows& rows, int row) {
  const auto text = [&](int column) { return std::string(rows.bytes(row, column)); };
  return {.stored = {.id = text(1),
                     .client = text(2),
                     .request_id = text(3),
                     .peer = text(4),
                     .traceparent = text(5),
                     .priority = static_cast<std::int64_t>(priority_of(rows.integer(row, 6))),
                     .accepted_unix_s = rows.real(row, 7),
                     .cancelled = rows.truth(row, 9),
                     .request = text(13)},
          .number = rows.integer(row, 0),
          .age_s = rows.real(row, 8) > 0.0 ? std::min(rows.real(row, 8), kOldest) : 0.0,
          .lost = static_cast<int>(std::clamp<std::int64_t>(rows.integer(row, 10), 0, kMostLost)),
          .token = text(11),
          .info = text(12)};
}

FleetStore::FleetStore(std::string uri, std::string server, const FleetLimits& limits, const Log& log,
                       FleetTaker& taker)
    : uri_(std::move(uri)),
      server_(std::move(server)),
      instance_(random_id()),
      limits_(limits),
      log_(log),
      taker_(taker),
      starvation_limit_(limits.queue.starvation_limit, limits.queue.starvation_time),
      changes_(
          log, [this](std::vector<Change>& changes) { return write(changes); }, kTick) {}

void FleetStore::add(std::shared_ptr<FleetJob> job, CompletionCallback settled) {
  looks_ = true;
  changes_.ask({.kind = Kind::add, .job = std::move(job), .settled = std::move(settled)});
}

void FleetStore::finish(StoredResult result, const std::string& token, CompletionCallback settled) {
  changes_.ask(
      {.kind = Kind::finish, .result = std::move(result), .token = token, .settled = std::move(settled)});
}

void FleetStore::release(const std::string& id, const std::string& token) {
  changes_.ask({.kind = Kind::release, .result = {.id = id}, .token = token});
}

void FleetStore::cancel(StoredResult if_waiting, CompletionCallback settled) {
  changes_.ask({.kind = Kind::cancel, .result = std::move(if_waiting), .settled = std::move(settled)});
}

void FleetStore::forget(const std::string& id, CompletionCallback settled) {
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

// A transaction that conflicted with another server's was undone, and is retried at once.
Expected<void> FleetStore::write(std::vector<Change>& changes) {
  if (auto connected = connect(); !connected) return connected;
  const auto now = std::chrono::steady_clock::now();
  const Due due{.second = now - second_ >= Seconds(1),
                .garbage_collector = now - garbage_collector_ >= kGarbageCollector};
  Expected<void> written;
  for (int i = 0; i < kTries; ++i) {
    try {
      written = write_once(changes, due);
    } catch (...) {
      database_->close();  // and the database undoes what it had begun
      throw;
    }
    if (written) break;
    if (database_->is_open()) (void)database_->run("ROLLBACK");
    if (!collided(database_->state())) break;
  }
  if (written && due.second) second_ = now;
  if (written && due.garbage_collector) garbage_collector_ = now;
  return written;
}

Expected<void> FleetStore::write_once(std::vector<Change>& changes, const Due& due) {
  if (auto renewed = renew(); !renewed) return renewed;
  const bool looks = looks_.exchange(false) || due.second;
  const FleetTaker::Room room = looks ? taker_.room() : FleetTaker::Room{};
  if (changes.empty() && room.jobs <= 0 && !due.second) return {};
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
  // After an outage of the network or the database, all servers have the time of a lease to renew theirs.
  const bool takes_over =
      due.second &&
      std::chrono::duration<double>(std::chrono::steady_clock::now() - connected_).count() > limits_.lease_s;
  if (takes_over) first.emplace_back(kTakeOver);
  if (adds) first.emplace_back("SELECT pg_advisory_xact_lock(hashtext('marble_jobs'))");
  const auto begun = database_->run(first);
  if (!begun) return unexpected(begun.error());
  bool reports = !changes.empty();
  if (takes_over) {
    const PgRows& late = (*begun)[first.size() - (adds ? 2 : 1)];
    for (int row = 0; row < late.size(); ++row) {
      reports = true;
      log_.warn(Component::server, "job_taken_over",
                {{"job", std::string(late.bytes(row, 0))}, {"from", std::string(late.bytes(row, 1))}});
    }
  }
  std::vector<TakenJob> taken;
  if (adds || room.jobs > 0) {
    auto now = lines();
    if (!now) return unexpected(now.error());
    if (adds) {
      if (auto added = add_all(changes, *now); !added) return added;
    }
    if (room.jobs > 0) {
      auto took = take(*now, room);
      if (!took) return unexpected(took.error());
      taken = std::move(*took);
      reports = reports || !taken.empty();
    }
  }
  if (due.garbage_collector) {
    if (auto cleaned = clean(); !cleaned) return cleaned;
  }
  std::vector<PgStatement> last;
  if (reports) last.emplace_back(kFleetNotify);
  last.emplace_back("COMMIT");
  if (reports) fault_point("before_commit");
  if (auto ended = database_->run(last); !ended) return unexpected(ended.error());
  if (reports) fault_point("after_commit");
  if (!taken.empty()) taker_.took(std::move(taken));
  return {};
}

// In a transaction that does not wait for the disk: lost data are soon written again.
Expected<void> FleetStore::renew() {
  const auto held = taker_.held();
  if (held.empty()) return {};
  std::vector<PgStatement> all;
  all.emplace_back("BEGIN");
  all.emplace_back("SET LOCAL synchronous_commit = off");
  append(all, PgStatement(kRenew).text(tokens_of(held)).real(limits_.lease_s));
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
  const auto rows = database_->run(PgStatement(kLines).number(limits_.job_starts));
  if (!rows) return unexpected(rows.error());
  Lines lines;
  for (int row = 0; row < rows->size(); ++row) {
    lines.push_back({.client = std::string(rows->bytes(row, 0)),
                     .priority = static_cast<std::size_t>(rows->integer(row, 1)),
                     .suspect = rows->truth(row, 6),
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
    auto line = std::ranges::find_if(lines, [&](const Line& one) {
      return one.client == stored.client && one.priority == priority && !one.suspect;
    });
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
Expected<std::vector<TakenJob>> FleetStore::take(const Lines& lines, FleetTaker::Room room) {
  std::map<std::string, std::int64_t> running;
  for (const Line& line : lines) running[line.client] += line.running;
  std::array<std::vector<Line>, kPriorities> able;
  for (const Line& line : lines) {
    if (line.waiting > 0 && line.priority < kPriorities) able[line.priority].push_back(line);
  }
  for (auto& turns : able) std::ranges::stable_sort(turns, {}, &Line::turn);
  using Place = std::tuple<std::string, std::size_t, bool>;
  std::map<Place, std::int64_t> counts;  // ordered as its locks are taken
  const auto now = std::chrono::steady_clock::now();
  for (int i = 0; i < room.jobs; ++i) {
    std::array<std::vector<Line>::iterator, kPriorities> next;
    std::array<bool, kPriorities> has = {};
    for (std::size_t at = 0; at < kPriorities; ++at) {
      next[at] = std::ranges::find_if(able[at], [&](const Line& line) {
        return line.waiting > 0 && (!line.suspect || room.suspect) &&
               running[line.client] < taker_.quota_of(line.client).running;
      });
      has[at] = next[at] != able[at].end();
    }
    const std::size_t at = starvation_limit_.choose(has, now);
    if (at == kPriorities) break;
    --next[at]->waiting;
    ++running[next[at]->client];
    ++counts[{next[at]->client, at, next[at]->suspect}];
    if (next[at]->suspect) room.suspect = false;
    std::rotate(next[at], next[at] + 1, able[at].end());
  }
  std::vector<TakenJob> taken;
  if (counts.empty()) return taken;
  const std::string token = instance_ + "." + std::to_string(++takes_) + ".";
  std::vector<PgStatement> all;
  for (const auto& [line, count] : counts)
    append(all, PgStatement(kTake)
                    .text(std::get<0>(line))
                    .number(static_cast<std::int64_t>(std::get<1>(line)))
                    .number(std::min(count, kMostOfALine))
                    .text(server_)
                    .text(token)
                    .real(limits_.lease_s)
                    .number(limits_.job_starts)
                    .text(std::get<2>(line) ? "true" : "false"));
  for (const auto& [line, count] : counts)
    append(all,
           PgStatement(kTurn).text(std::get<0>(line)).number(static_cast<std::int64_t>(std::get<1>(line))));
  const auto took = database_->run(all);
  if (!took) return unexpected(took.error());
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const PgRows& rows = (*took)[i];
    for (int row = 0; row < rows.size(); ++row) taken.push_back(taken_in(rows, row));
  }
  return taken;
}

// Removes expired results, and those beyond the limits; one server at a time.
Expected<void> FleetStore::clean() {
  const auto first = database_->run("SELECT pg_try_advisory_xact_lock(hashtext('marble_clean'))");
  if (!first) return unexpected(first.error());
  if (!first->truth(0, 0)) return {};
  std::vector<PgStatement> all;
  // Repairs values that no server writes, and with which no server would take the job.
  all.emplace_back(
      "UPDATE marble_jobs SET priority = least(greatest(priority, 0), 2), state = greatest(state, 0),"
      " changed = pg_current_xact_id() WHERE state < 2 AND (state < 0 OR priority NOT BETWEEN 0 AND 2)");
  append(all,
         PgStatement(
             "UPDATE marble_jobs SET state = 3, ended = clock_timestamp(),"
             " changed = pg_current_xact_id()"
             " WHERE state = 2 AND (ended IS NULL OR ended < clock_timestamp() - make_interval(secs => $1)"
             " OR ended > clock_timestamp() + interval '1 day')")
             .real(limits_.keep_s));
  append(all, PgStatement("UPDATE marble_jobs SET state = 3, ended = clock_timestamp(),"
                          " changed = pg_current_xact_id() WHERE number IN (SELECT number FROM ("
                          "SELECT number, sum(answer_bytes) OVER (ORDER BY ended DESC, number DESC) AS upto"
                          " FROM marble_jobs WHERE state = 2) kept WHERE upto > $1)")
                  .number(limits_.answer_bytes));
  all.emplace_back(
      "DELETE FROM marble_answers USING marble_jobs j WHERE j.state = 3"
      " AND marble_answers.number = j.number");
  // Requests of jobs with a result use the space that results leave.
  append(all,
         PgStatement("DELETE FROM marble_requests USING (SELECT number,"
                     " sum(bytes) OVER (ORDER BY ended DESC, number DESC) + sum(answer_bytes) OVER () AS upto"
                     " FROM marble_jobs WHERE state = 2) kept"
                     " WHERE marble_requests.number = kept.number AND upto > $1")
             .number(limits_.keeps_requests ? limits_.answer_bytes : -1));
  all.emplace_back(
      "DELETE FROM marble_requests USING marble_jobs j WHERE j.state = 3 AND marble_requests.number = "
      "j.number");
  all.emplace_back(
      "DELETE FROM marble_jobs WHERE state >= 3 AND ended < clock_timestamp() - interval '10 min'");
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
