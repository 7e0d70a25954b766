#include "fleet/fleet_store.h"

#include <array>
#include <iterator>
#include <map>
#include <tuple>

#include "base/fault_point.h"
#include "base/random_id.h"
#include "fleet/fleet_array_statements.h"
#include "fleet/fleet_statements.h"

namespace marble::server {
namespace {

using Seconds = std::chrono::seconds;

constexpr std::chrono::milliseconds kTick{250};
constexpr Seconds kGarbageCollector{2};
constexpr int kTries = 5;                   // attempts of a transaction that conflicted with another
constexpr std::int64_t kAnswerBytes = 512;  // memory of a result besides its message
constexpr double kOldest = 4e9;             // limit on a job's age in seconds: clocks count no further
constexpr std::int64_t kMostLost = 1'000'000;
constexpr std::int64_t kMostClaimedBytes = 8 << 20;  // of an array, in one claim
constexpr std::int64_t kMostOfALine = 64;            // jobs of one client and priority in one take

bool collided(const std::string& state) { return state.starts_with("40"); }

std::string tokens_of(const std::vector<std::pair<std::string, std::string>>& held) {
  std::vector<std::string> tokens;
  for (const auto& [id, token] : held) tokens.push_back(token);
  return text_array(tokens);
}

void append(std::vector<PgStatement>& all, PgStatement&& one) { all.push_back(std::move(one)); }

std::optional<std::int64_t> array_size(std::int64_t elements) {
  return elements > 0 ? std::optional(elements) : std::nullopt;
}

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
                     .request = text(13),
                     .elements = array_size(rows.integer(row, 14))},
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

void FleetStore::open_array(std::shared_ptr<FleetJob> job, CompletionCallback settled) {
  changes_.ask({.kind = Kind::open, .job = std::move(job), .settled = std::move(settled)});
}

void FleetStore::add_element(std::shared_ptr<FleetJob> job, StoredElement element,
                             CompletionCallback settled) {
  changes_.ask({.kind = Kind::add_element,
                .job = std::move(job),
                .element = std::move(element),
                .settled = std::move(settled)});
}

void FleetStore::seal_array(std::shared_ptr<FleetJob> job, StoredResult whole, CompletionCallback settled) {
  looks_ = true;
  changes_.ask(
      {.kind = Kind::seal, .job = std::move(job), .result = std::move(whole), .settled = std::move(settled)});
}

void FleetStore::drop_array(std::shared_ptr<FleetJob> job) {
  changes_.ask({.kind = Kind::drop, .job = std::move(job)});
}

void FleetStore::claim_elements(std::shared_ptr<ElementClaim> claim, CompletionCallback settled) {
  changes_.ask({.kind = Kind::claim, .claim = std::move(claim), .settled = std::move(settled)});
}

void FleetStore::answer_element(ElementAnswer answer, const std::string& token, CompletionCallback settled) {
  changes_.ask(
      {.kind = Kind::answer, .token = token, .answer = std::move(answer), .settled = std::move(settled)});
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
  MARBLE_ASSIGN_OR_RETURN(auto opened, Postgres::open(uri_));
  MARBLE_RETURN_IF_ERROR(prepare_fleet(opened));
  database_ = std::move(opened);
  connected_ = std::chrono::steady_clock::now();
  looks_ = true;
  return {};
}

// A transaction that conflicted with another server's was undone, and is retried at once.
Expected<void> FleetStore::write(std::vector<Change>& changes) {
  MARBLE_RETURN_IF_ERROR(connect());
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
  MARBLE_RETURN_IF_ERROR(renew());
  const bool looks = looks_.exchange(false) || due.second;
  const FleetTaker::Room room = looks ? taker_.room() : FleetTaker::Room{};
  if (changes.empty() && room.jobs <= 0 && !due.second) return {};
  std::vector<PgStatement> first;
  first.emplace_back("BEGIN");
  std::vector<std::pair<ElementClaim*, std::size_t>> claims;  // and their statements
  for (const Change& change : changes) {
    const StoredResult& result = change.result;
    const ElementAnswer& answer = change.answer;
    switch (change.kind) {
      case Kind::add:
      case Kind::open:
      case Kind::add_element:
      case Kind::seal:
        break;
      case Kind::finish:
        append(first, PgStatement(kFinish)
                          .text(result.id)
                          .text(change.token)
                          .number(static_cast<std::int64_t>(result.answer.size()) + kAnswerBytes +
                                  result.element_bytes)
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
      case Kind::drop:
        drafts_.erase(change.job->stored.id);
        append(first, PgStatement(kDropArray).text(change.job->stored.id).text(change.job->token));
        break;
      case Kind::claim:
        claims.emplace_back(change.claim.get(), first.size());
        append(first, PgStatement(kClaim)
                          .text(change.claim->id)
                          .text(change.claim->token)
                          .number(change.claim->number)
                          .text(change.claim->suspect ? "true" : "false")
                          .number(limits_.job_starts)
                          .number(std::max<std::int64_t>(change.claim->most, 1))
                          .number(kMostClaimedBytes));
        break;
      case Kind::answer:
        append(first, PgStatement(kAnswerElement)
                          .text(answer.array)
                          .text(change.token)
                          .number(answer.index)
                          .number(static_cast<std::int64_t>(answer.end))
                          .number(answer.iterations)
                          .number(answer.factorizations)
                          .blob(answer.message));
        break;
    }
  }
  const bool adds = std::ranges::any_of(changes, &Change::adds);
  // After an outage of the network or the database, all servers have the time of a lease to renew theirs.
  const bool takes_over =
      due.second &&
      std::chrono::duration<double>(std::chrono::steady_clock::now() - connected_).count() > limits_.lease_s;
  const std::size_t take_over = first.size();
  if (takes_over) {
    first.emplace_back(kTakeOver);
    first.emplace_back(kDropLateArrays);
  }
  if (adds) first.emplace_back("SELECT pg_advisory_xact_lock(hashtext('marble_jobs'))");
  MARBLE_ASSIGN_OR_RETURN(const auto begun, database_->run(first));
  for (const auto& [claim, statement] : claims) read_claim(begun[statement], *claim);
  bool reports = std::ranges::any_of(changes, &Change::is_news);
  if (takes_over) {
    const PgRows& late = begun[take_over];
    for (int row = 0; row < late.size(); ++row) {
      reports = true;
      log_.warn(Component::server, "job_taken_over",
                {{"job", std::string(late.bytes(row, 0))}, {"from", std::string(late.bytes(row, 1))}});
    }
  }
  std::vector<TakenJob> taken;
  if (adds || room.jobs > 0) {
    MARBLE_ASSIGN_OR_RETURN(auto now, lines());
    if (adds) {
      MARBLE_RETURN_IF_ERROR(add_all(changes, now));
    }
    if (room.jobs > 0) {
      MARBLE_ASSIGN_OR_RETURN(taken, take(now, room));
      MARBLE_RETURN_IF_ERROR(count_elements(taken));
      reports = reports || !taken.empty();
    }
  }
  if (due.garbage_collector) {
    MARBLE_RETURN_IF_ERROR(clean());
  }
  std::vector<PgStatement> last;
  if (reports) last.emplace_back(kFleetNotify);
  last.emplace_back("COMMIT");
  if (reports) fault_point("before_commit");
  MARBLE_RETURN_IF_ERROR(database_->run(last));
  if (reports) fault_point("after_commit");
  if (!taken.empty()) taker_.took(std::move(taken));
  return {};
}

// In a transaction that does not wait for the disk: lost data are soon written again.
Expected<void> FleetStore::renew() {
  const auto held = taker_.held();
  if (held.empty() && drafts_.empty()) return {};
  auto all_held = held;
  all_held.insert(all_held.end(), drafts_.begin(), drafts_.end());
  std::vector<PgStatement> all;
  all.emplace_back("BEGIN");
  all.emplace_back("SET LOCAL synchronous_commit = off");
  append(all, PgStatement(kRenew).text(tokens_of(all_held)).real(limits_.lease_s));
  for (const LiveJob& job : taker_.live()) {
    append(all, PgStatement(kLive)
                    .number(job.number)
                    .text(job.token)
                    .number(job.first)
                    .number(job.upto)
                    .blob(job.rows)
                    .blob(job.info)
                    .blob(job.job));
    if (job.is_array)
      append(all, PgStatement(kArraySizes)
                      .number(job.number)
                      .text(job.token)
                      .number(job.request_bytes)
                      .number(job.answer_bytes));
  }
  all.emplace_back("COMMIT");
  MARBLE_ASSIGN_OR_RETURN(const auto renewed, database_->run(all));
  const PgRows& ours = renewed[2];
  for (int row = 0; row < ours.size(); ++row) {
    if (ours.truth(row, 1)) taker_.cancelled(std::string(ours.bytes(row, 0)));
  }
  if (static_cast<std::size_t>(ours.size()) == all_held.size()) return {};
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
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database_->run(PgStatement(kLines).number(limits_.job_starts)));
  Lines lines;
  for (int row = 0; row < rows.size(); ++row) {
    lines.push_back({.client = std::string(rows.bytes(row, 0)),
                     .priority = static_cast<std::size_t>(rows.integer(row, 1)),
                     .suspect = rows.truth(row, 6),
                     .waiting = rows.integer(row, 2),
                     .running = rows.integer(row, 3),
                     .bytes = rows.integer(row, 4),
                     .turn = rows.integer(row, 5),
                     .drafts = rows.integer(row, 7)});
  }
  return lines;
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
  MARBLE_ASSIGN_OR_RETURN(const auto took, database_->run(all));
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const PgRows& rows = took[i];
    for (int row = 0; row < rows.size(); ++row) taken.push_back(taken_in(rows, row));
  }
  return taken;
}

}  // namespace marble::server
