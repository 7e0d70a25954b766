#include "fleet/fleet_mirror.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "service/job_message.h"
#include "service/stored_job.h"
#include "submissions/array.h"

namespace marble::server {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kQuiet{1000};   // between two reads without a request
constexpr milliseconds kWatched{250};  // between two reads of running jobs

// Of one job, so that their number never overflows.
constexpr std::int64_t kMostRows = std::int64_t{1} << 40;

// Only the newest of the jobs with a result are read in full: as many as the board keeps.
constexpr const char* kAll =
    "WITH recent AS (SELECT number FROM marble_jobs WHERE state = 2 ORDER BY ended DESC, number DESC LIMIT "
    "$1)"
    " SELECT id, j.number, client, peer, priority, state, cancelled, server,"
    " CASE WHEN state < 2 OR recent.number IS NOT NULL THEN info ELSE ''::bytea END,"
    " pg_snapshot_xmin(pg_current_snapshot())::text, extract(epoch FROM accepted)::float8,"
    " coalesce(elements, 0) FROM marble_jobs j LEFT JOIN recent ON recent.number = j.number WHERE state < 3"
    " ORDER BY state = 2 DESC, CASE WHEN state = 2 THEN ended END, j.number";
constexpr const char* kChanges =
    "SELECT id, number, client, peer, priority, state, cancelled, server, info,"
    " pg_snapshot_xmin(pg_current_snapshot())::text, extract(epoch FROM accepted)::float8,"
    " coalesce(elements, 0) FROM marble_jobs WHERE changed >= $1::xid8 ORDER BY number";
constexpr const char* kHorizon = "SELECT pg_snapshot_xmin(pg_current_snapshot())::text";
constexpr const char* kWhole =
    "SELECT coalesce(a.job, l.job), coalesce(l.upto, 0) FROM marble_jobs j"
    " LEFT JOIN marble_answers a USING (number) LEFT JOIN marble_live l USING (number)"
    " WHERE j.id = $1 AND (a.job IS NOT NULL OR l.job IS NOT NULL)";
constexpr const char* kLiveRows =
    "SELECT j.id, l.first, l.upto, l.info, CASE WHEN j.id = ANY ($1::text[]) THEN l.rows ELSE ''::bytea END"
    " FROM marble_live l JOIN marble_jobs j USING (number) WHERE j.state = 1";
constexpr const char* kAnswer =
    "SELECT answer, error, elements IS NOT NULL FROM marble_jobs JOIN marble_answers USING (number) WHERE id "
    "= $1 AND state = 2";

constexpr const char* kBoth =
    "SELECT request, coalesce(answer, ''::bytea) FROM marble_jobs JOIN marble_requests USING (number)"
    " LEFT JOIN marble_answers USING (number) WHERE id = $1 AND state < 3 AND elements IS NULL";

JobSnapshot snapshot_in(const PgRows& rows, int row, int column, FleetState state) {
  JobSnapshot snapshot = stored_snapshot(rows.bytes(row, column));
  snapshot.state = state == FleetState::waiting   ? JobState::queued
                   : state == FleetState::running ? JobState::running
                                                  : JobState::finished;
  return snapshot;
}

}  // namespace

FleetMirror::FleetMirror(const ServiceParts& parts, FleetOwner& owner)
    : parts_(parts), owner_(owner), bell_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

void FleetMirror::ring() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(bell_.get(), &one, sizeof one);
}

void FleetMirror::wait(milliseconds patience) {
  const auto end = std::chrono::steady_clock::now() + patience;
  const MutexLock lock(mutex_);
  while (!well_ && well_again_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
  }
}

void FleetMirror::look(const std::string& id, CompletionCallback then) {
  Expected<void> well;
  {
    const MutexLock lock(mutex_);
    well = well_;
    if (well && !closing_) {
      asked_.looks.push_back({id, std::move(then)});
      ring();
      return;
    }
  }
  report({id, std::move(then)}, well);
}

// A known job is reported in any state, even an old one; an unknown one must not be reported as gone.
void FleetMirror::report(const Look& look, const Expected<void>& looked) const {
  const bool known =
      look.id.empty() || !parts_.results.owner(look.id).empty() || parts_.board.find(look.id) != nullptr;
  look.then(known ? Expected<void>() : looked);
}

void FleetMirror::fetch(const std::string& id) {
  const MutexLock lock(mutex_);
  asked_.fetches.push_back(id);
  ring();
}

void FleetMirror::fetch_pair(const std::string& id, std::function<void(Expected<AskedAndAnswered>)> then) {
  Expected<void> well;
  {
    const MutexLock lock(mutex_);
    well = closing_ ? unexpected(draining()) : well_;
    if (well) {
      asked_.pair_fetches.push_back({id, std::move(then)});
      ring();
      return;
    }
  }
  then(unexpected(well.error()));
}

void FleetMirror::find_array(const std::string& id, FleetReaders::Find then) {
  Expected<void> well;
  {
    const MutexLock lock(mutex_);
    well = closing_ ? unexpected(draining()) : well_;
    if (well) return readers_.find(id, std::move(then));
  }
  then(unexpected(well.error()));
}

void FleetMirror::read_anew(const std::string& id) {
  const MutexLock lock(mutex_);
  asked_.anew.push_back(id);
  ring();
}

bool FleetMirror::is_settled() const {
  const MutexLock lock(mutex_);
  return !well_ ||
         (!working_ && asked_.looks.empty() && asked_.fetches.empty() && asked_.pair_fetches.empty());
}

void FleetMirror::close() {
  {
    const MutexLock lock(mutex_);
    closing_ = true;
    ring();
  }
  if (thread_.joinable()) thread_.join();
}

FleetMirror::Asked FleetMirror::take() {
  std::uint64_t rings = 0;
  [[maybe_unused]] const auto taken = read(bell_.get(), &rings, sizeof rings);
  const MutexLock lock(mutex_);
  working_ = true;
  return std::exchange(asked_, {});
}

void FleetMirror::set_well(const Expected<void>& done) {
  const MutexLock lock(mutex_);
  well_ = done;
  working_ = false;
  well_again_.notify_all();
}

void FleetMirror::run() {
  const auto is_closing = [this] {
    const MutexLock lock(mutex_);
    return closing_;
  };
  while (true) {
    Expected<bool> reported = false;
    if (database_ && database_->is_open()) {
      reported = database_->wait(bell_.get(), readers_.patience(parts_.feeds.open() > 0 ? kWatched : kQuiet));
    }
    const Asked asked = take();
    Expected<void> done = reported ? attempt(asked, *reported) : unexpected(reported.error());
    set_well(done);
    if (!done) readers_.refuse(done.error());
    for (const Look& look : asked.looks) report(look, done);
    for (const PairFetch& fetch_pair : asked.pair_fetches) {
      auto both = done ? read_both(fetch_pair.id) : unexpected(done.error());
      fetch_pair.then(std::move(both));
    }
    if (is_closing()) break;
    if (!done) {
      if (database_) database_->close();
      std::array ends = {pollfd{bell_.get(), POLLIN, 0}};
      poll(ends.data(), ends.size(), static_cast<int>(kQuiet.count()));
    }
  }
  readers_.refuse(draining());
  // Requests that arrived between the last round and now.
  const Asked late = take();
  for (const Look& look : late.looks) report(look, {});
  for (const PairFetch& fetch_pair : late.pair_fetches) fetch_pair.then(unexpected(draining()));
  const MutexLock lock(mutex_);
  working_ = false;  // calls that wait for changes end once this is settled
}

// No exception ends the thread, and with it the server.
Expected<void> FleetMirror::attempt(const Asked& asked, bool changed) {
  try {
    MARBLE_RETURN_IF_ERROR(connect());
    MARBLE_RETURN_IF_ERROR(answer(asked));
    return readers_.serve(*database_, changed);
  } catch (const std::exception& error) {
    return unexpected(failure(ErrorCode::unavailable, "state", "", error.what()));
  }
}

Expected<void> FleetMirror::connect() {
  if (database_ && database_->is_open()) return {};
  MARBLE_ASSIGN_OR_RETURN(auto opened, Postgres::open(parts_.config.state));
  MARBLE_RETURN_IF_ERROR(prepare_fleet(opened));
  MARBLE_RETURN_IF_ERROR(opened.run(kFleetListen));
  database_ = std::move(opened);
  return read_all();
}

Expected<void> FleetMirror::answer(const Asked& asked) {
  wanted_.insert(wanted_.end(), asked.fetches.begin(), asked.fetches.end());
  for (const std::string& id : asked.anew) known_.erase(id);
  MARBLE_RETURN_IF_ERROR(asked.anew.empty() ? read_changes() : read_all());
  for (const std::string& id : asked.anew) {
    if (!known_.contains(id)) forget(id);
  }
  for (const Look& look : asked.looks) {
    if (look.id.empty()) continue;
    MARBLE_RETURN_IF_ERROR(read_whole(look.id));
  }
  const bool lists = std::ranges::any_of(asked.looks, [](const Look& look) { return look.id.empty(); });
  if (lists || parts_.feeds.open() > 0) {
    MARBLE_RETURN_IF_ERROR(read_live());
  }
  {
    const MutexLock lock(mutex_);  // results that were requested meanwhile
    const auto more = std::exchange(asked_.fetches, {});
    wanted_.insert(wanted_.end(), more.begin(), more.end());
  }
  while (!wanted_.empty()) {
    MARBLE_RETURN_IF_ERROR(read_answer(wanted_.back()));
    wanted_.pop_back();
  }
  return {};
}

Expected<void> FleetMirror::read_all() {
  // read first: changes made meanwhile are read again
  MARBLE_ASSIGN_OR_RETURN(const auto horizon, database_->run(kHorizon));
  MARBLE_ASSIGN_OR_RETURN(const auto rows,
                          database_->run(PgStatement(kAll).number(parts_.config.history_jobs)));
  horizon_ = std::string(horizon.bytes(0, 0));
  std::set<std::string> there;
  for (int row = 0; row < rows.size(); ++row) {
    apply(rows, row);
    there.insert(std::string(rows.bytes(row, 0)));
  }
  std::vector<std::string> gone;
  for (const auto& [id, known] : known_) {
    if (!there.contains(id)) gone.push_back(id);
  }
  for (const std::string& id : gone) forget(id);
  wait_in_line();
  return {};
}

Expected<void> FleetMirror::read_changes() {
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database_->run(PgStatement(kChanges).text(horizon_)));
  if (rows.size() == 0) return {};
  horizon_ = std::string(rows.bytes(0, 9));
  for (int row = 0; row < rows.size(); ++row) apply(rows, row);
  wait_in_line();
  return {};
}

void FleetMirror::forget(const std::string& id) {
  known_.erase(id);
  const auto record = parts_.board.find(id);
  if (record != nullptr && owner_.has(id)) record->cancel();
  parts_.results.forget(id);
  parts_.board.forget(id);
}

void FleetMirror::apply(const PgRows& rows, int row) {
  const std::string id(rows.bytes(row, 0));
  const auto state = static_cast<FleetState>(rows.integer(row, 5));
  if (state >= FleetState::gone) return forget(id);
  const auto [entry, is_new] = known_.try_emplace(id);
  Known& known = entry->second;
  known.number = rows.integer(row, 1);
  known.priority = static_cast<std::size_t>(priority_of(rows.integer(row, 4)));
  if (state != known.state || rows.bytes(row, 7) != known.server) known.upto = -1;
  known.state = state;
  known.server = rows.bytes(row, 7);
  if (is_new) (void)parts_.results.expect(id, std::string(rows.bytes(row, 2)));
  const bool is_here = !owner_.unless_here(id, [&, is_new = is_new] { show(id, known, rows, row, is_new); });
  if (const auto record = parts_.board.find(id); is_here && record != nullptr && rows.truth(row, 6))
    record->cancel();
  if (state == FleetState::answered) parts_.results.kept_elsewhere(id);
}

// Shows a job of another server on the board.
void FleetMirror::show(const std::string& id, Known& known, const PgRows& rows, int row, bool is_new) {
  const std::string_view reported = rows.bytes(row, 8);
  auto record = parts_.board.find(id);
  if (record != nullptr && record->is_finished()) {
    if (known.state != FleetState::answered) return;  // ended on this server; the store does not have it yet
    known.is_whole = known.is_whole || is_new || !record->trace().rows.empty();
  }
  // Of jobs with a result, only the newest come with it.
  if ((reported.empty() && known.state == FleetState::answered) || known.is_whole) return;
  if (record == nullptr) {
    if (!is_new && known.state == FleetState::answered) return;  // the board has dropped it
    const StoredJob stored{
        .id = id,
        .client = std::string(rows.bytes(row, 2)),
        .peer = std::string(rows.bytes(row, 3)),
        .priority = rows.integer(row, 4),
        .accepted_unix_s = rows.real(row, 10),
        .elements = rows.integer(row, 11) > 0 ? std::optional(rows.integer(row, 11)) : std::nullopt};
    record = parts_.board.make(description_of(stored, reported), Options());
    parts_.board.add(record);
  }
  JobSnapshot snapshot = snapshot_in(rows, row, 8, known.state);
  snapshot.server = known.server;
  record->restore(std::move(snapshot), {});
  if (known.state == FleetState::answered) parts_.board.finish(record);
  if (known.state != FleetState::waiting) return;
  record->set_place([waiting = waiting_, place = std::pair(known.priority, known.number)] {
    const MutexLock lock(waiting->mutex);
    const auto at = std::ranges::lower_bound(waiting->line, place);
    return QueuePlace{static_cast<int>(at - waiting->line.begin()), 0.0};
  });
}

void FleetMirror::wait_in_line() {
  std::vector<std::pair<std::size_t, std::int64_t>> line;
  for (const auto& [id, known] : known_) {
    if (known.state == FleetState::waiting) line.emplace_back(known.priority, known.number);
  }
  std::ranges::sort(line);
  const bool some = !line.empty();
  {
    const MutexLock lock(waiting_->mutex);
    waiting_->line.swap(line);
  }
  if (some) owner_.jobs_wait();
}

// Reads the job's trace and options, which only requests for this job need.
Expected<void> FleetMirror::read_whole(const std::string& id) {
  const auto found = known_.find(id);
  if (found == known_.end() || found->second.is_whole) return {};
  const auto record = parts_.board.find(id);
  if (record == nullptr || record->is_watched()) return {};
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database_->run(PgStatement(kWhole).text(id)));
  if (rows.size() == 0) return {};
  v1::GetJobResponse job;
  const std::string_view bytes = rows.bytes(0, 0);
  if (!job.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return {};
  JobSnapshot snapshot = snapshot_of(job);
  snapshot.server = record->snapshot().server;
  owner_.unless_here(id, [&] {
    found->second.is_whole = snapshot.state == JobState::finished;
    found->second.upto = rows.integer(0, 1);
    record->set_options(options_of(job.options()).value_or(Options()));
    record->restore(std::move(snapshot), trace_of(job.trace()));
  });
  return {};
}

Expected<void> FleetMirror::read_live() {
  std::vector<std::string> watched;
  const JobBoard::Records active = parts_.board.active();
  for (const auto& record : *active) {
    if (record->is_watched() && known_.contains(record->id())) watched.push_back(record->id());
  }
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database_->run(PgStatement(kLiveRows).text(text_array(watched))));
  for (int row = 0; row < rows.size(); ++row) {
    const std::string id(rows.bytes(row, 0));
    const auto found = known_.find(id);
    const auto record = parts_.board.find(id);
    if (found == known_.end() || found->second.state != FleetState::running) continue;
    const std::int64_t first = std::clamp<std::int64_t>(rows.integer(row, 1), 0, kMostRows);
    const std::int64_t upto = std::clamp<std::int64_t>(rows.integer(row, 2), 0, kMostRows);
    std::int64_t& seen = found->second.upto;
    if (record == nullptr || upto == seen) continue;
    v1::JobEvent event;
    const std::string_view bytes = rows.bytes(row, 4);
    event.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
    std::vector<Progress> reported;
    for (std::int64_t at = first; const v1::Progress& progress : event.rows()) {
      if (at++ >= seen) reported.push_back(progress_of(progress));
    }
    owner_.unless_here(id, [&] {
      if (record->is_watched())
        record->follow(seen < 0 ? first : std::max<std::int64_t>(0, first - seen), reported);
      JobSnapshot snapshot = snapshot_in(rows, row, 3, FleetState::running);
      snapshot.server = record->snapshot().server;
      record->restore(std::move(snapshot), {});
      seen = upto;
    });
  }
  return {};
}

Expected<AskedAndAnswered> FleetMirror::read_both(const std::string& id) {
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database_->run(PgStatement(kBoth).text(id)));
  if (rows.size() == 0) return unexpected(Submissions::no_request(id));
  return AskedAndAnswered{std::string(rows.bytes(0, 0)), std::string(rows.bytes(0, 1))};
}

Expected<void> FleetMirror::read_answer(const std::string& id) {
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database_->run(PgStatement(kAnswer).text(id)));
  if (rows.size() == 0) return {};  // gone, as the next changes will show
  parts_.results.deliver(
      id, rows.truth(0, 2) ? no_single_answer(id) : stored_answer(rows.bytes(0, 0), rows.bytes(0, 1)));
  return {};
}

}  // namespace marble::server
