#include "store/job_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/fault_point.h"

namespace marble::server {
namespace {

constexpr const char* kFile = "/jobs.sqlite";
constexpr const char* kLock = "/lock";
constexpr const char* kRunning = "/running";
constexpr const char* kApplication = "1298297459";  // "Mbrs", SQLite's application_id
constexpr const char* kVersion = "3";               // version of the tables, SQLite's user_version
constexpr const char* kWithoutArrays = "2";
constexpr const char* kWithoutStarts = "1";  // also without jobs.lost

// `number` is the order of acceptance, `ended` that of the results.
constexpr const char* kTables = R"(
CREATE TABLE jobs (
  number INTEGER PRIMARY KEY,
  id TEXT NOT NULL UNIQUE,
  client TEXT NOT NULL, request_id TEXT NOT NULL, digest BLOB NOT NULL,
  peer TEXT NOT NULL, traceparent TEXT NOT NULL,
  priority INTEGER NOT NULL, accepted_unix_s REAL NOT NULL, cancelled INTEGER NOT NULL,
  request BLOB, lost INTEGER NOT NULL DEFAULT 0);
CREATE TABLE answers (
  ended INTEGER PRIMARY KEY,
  id TEXT NOT NULL UNIQUE REFERENCES jobs (id) ON DELETE CASCADE,
  finished_unix_s REAL NOT NULL,
  job BLOB NOT NULL, answer BLOB NOT NULL, error BLOB NOT NULL);
)";

// A job without a client would count as one that is not kept.
std::string owner_of(std::string client) { return client.empty() ? "?" : client; }

Error fault(const std::string& where, std::string why) {
  return failure(ErrorCode::unavailable, "state_dir", where, std::move(why));
}

Expected<Descriptor> locked(const std::string& directory) {
  if (mkdir(directory.c_str(), S_IRWXU) != 0 && errno != EEXIST)
    return unexpected(fault(directory, std::strerror(errno)));
  const std::string file = directory + kLock;
  Descriptor descriptor(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR));
  if (!descriptor) return unexpected(fault(file, std::strerror(errno)));
  if (flock(descriptor.get(), LOCK_EX | LOCK_NB) != 0)
    return unexpected(fault(directory, "another server uses it"));
  return descriptor;
}

// Returns the file's version; "0" if the file is new. An error unless it is ours and intact.
Expected<std::string> version_of(Database& database, const std::string& file) {
  MARBLE_ASSIGN_OR_RETURN(const auto application, database.ask("PRAGMA application_id"));
  MARBLE_ASSIGN_OR_RETURN(auto version, database.ask("PRAGMA user_version"));
  MARBLE_ASSIGN_OR_RETURN(const auto tables, database.ask("SELECT count(*) FROM sqlite_master"));
  if (application != kApplication && (application != "0" || tables != "0"))
    return unexpected(fault(file, "is a file of another program"));
  if (version != "0" && version != kWithoutStarts && version != kWithoutArrays && version != kVersion)
    return unexpected(fault(file, "is of version " + version + ", this server knows " + kVersion));
  MARBLE_ASSIGN_OR_RETURN(const auto check, database.ask("PRAGMA quick_check(1)"));
  if (check != "ok") return unexpected(fault(file, "is damaged: " + check));
  return version;
}

Expected<void> prepare(Database& database, const std::string& file) {
  MARBLE_ASSIGN_OR_RETURN(const auto version, version_of(database, file));
  MARBLE_ASSIGN_OR_RETURN(const auto mode, database.ask("PRAGMA journal_mode = WAL"));
  if (mode != "wal") return unexpected(fault(file, "cannot be in SQLite's mode WAL, but in " + mode));
  MARBLE_RETURN_IF_ERROR(database.run("PRAGMA synchronous = FULL"));
  if (version == kVersion) return {};
  std::string make = "BEGIN;";
  if (version == "0") make += std::string(kTables) + "PRAGMA application_id = " + kApplication + ";";
  if (version == kWithoutStarts) make += "ALTER TABLE jobs ADD COLUMN lost INTEGER NOT NULL DEFAULT 0;";
  return database.run(make + kArrayTables + "PRAGMA user_version = " + kVersion + "; COMMIT");
}

// Texts that were stored as another type would not equal any text in a query. Ids change in both tables, so
// that foreign keys are valid again afterwards.
Expected<void> set_types(Database& database) {
  return database.run(
      "PRAGMA foreign_keys = OFF; BEGIN;"
      "UPDATE OR IGNORE jobs SET id = CAST(id AS TEXT), client = CAST(client AS TEXT),"
      " request_id = CAST(request_id AS TEXT), peer = CAST(peer AS TEXT), traceparent = CAST(traceparent AS "
      "TEXT)"
      " WHERE typeof(id) <> 'text' OR typeof(client) <> 'text' OR typeof(request_id) <> 'text'"
      " OR typeof(peer) <> 'text' OR typeof(traceparent) <> 'text';"
      "UPDATE OR IGNORE answers SET id = CAST(id AS TEXT) WHERE typeof(id) <> 'text';"
      "COMMIT; PRAGMA foreign_keys = ON");
}

// Jobs that ran when the last server was killed get one more start that the server did not survive.
Expected<void> count_starts(Database& database, RunningJobs& running) {
  MARBLE_ASSIGN_OR_RETURN(auto statement,
                          database.prepare("UPDATE jobs SET lost = max(lost, ?2) WHERE id = ?1"));
  for (const JobStart& start : running.left()) {
    MARBLE_RETURN_IF_ERROR(statement.bind(1, start.id).bind(2, std::int64_t{start.number}).run());
    MARBLE_RETURN_IF_ERROR(count_element_starts(database, start));
  }
  return running.clear();
}

std::optional<std::int64_t> elements_in(const Statement& row, int column) {
  if (row.is_null(column)) return std::nullopt;
  return row.integer(column);
}

// The server's files are for its user alone, whatever the umask was when they were written.
void narrow(const std::string& file, const Log& log) {
  struct stat facts = {};
  constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
  if (lstat(file.c_str(), &facts) != 0 || !S_ISREG(facts.st_mode) || (facts.st_mode & kOthers) == 0) return;
  const bool done = chmod(file.c_str(), facts.st_mode & ~kOthers & ALLPERMS) == 0;
  log.warn(Component::server, done ? "state_mode_narrowed" : "state_mode_is_wide", {{"file", file}});
}

}  // namespace

StoredJob job_in(const Statement& row) {
  return {.id = row.bytes(0),
          .client = owner_of(row.bytes(1)),
          .request_id = row.bytes(2),
          .digest = row.bytes(3),
          .peer = row.bytes(4),
          .traceparent = row.bytes(5),
          .priority = row.integer(6),
          .accepted_unix_s = row.real(7),
          .lost = row.integer(10),
          .cancelled = row.integer(8) != 0,
          .request = {},
          .request_bytes = row.integer(9),
          .elements = elements_in(row, 11)};
}

StoredResult result_in(const Statement& row) {
  return {.id = row.bytes(0),
          .client = owner_of(row.bytes(1)),
          .request_id = row.bytes(2),
          .digest = row.bytes(3),
          .job = row.bytes(4),
          .answer = row.bytes(5),
          .error = row.bytes(6),
          .finished_unix_s = row.real(7),
          .request_bytes = row.integer(8),
          .elements = elements_in(row, 9)};
}

JobStore::JobStore(std::string file, Descriptor lock, RunningJobs running, Database writer, Database reader,
                   const Log& log)
    : file_(std::move(file)),
      lock_(std::move(lock)),
      running_(std::move(running)),
      writer_(std::move(writer)),
      reader_(std::move(reader)),
      changes_(log, [this](std::vector<Change>& changes) { return write(changes); }) {}

Expected<std::unique_ptr<JobStore>> JobStore::open(const std::string& directory, const Log& log) {
  MARBLE_ASSIGN_OR_RETURN(auto lock, locked(directory));
  const std::string file = directory + kFile;
  // SQLite gives its other files the mode of this one.
  const Descriptor made(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR));
  for (const std::string& one : {file, file + "-wal", file + "-shm", directory + kLock, directory + kRunning})
    narrow(one, log);
  MARBLE_ASSIGN_OR_RETURN(auto running, RunningJobs::open(directory + kRunning));
  MARBLE_ASSIGN_OR_RETURN(auto writer, Database::open(file));
  MARBLE_RETURN_IF_ERROR(prepare(writer, file));
  MARBLE_RETURN_IF_ERROR(set_types(writer));
  MARBLE_RETURN_IF_ERROR(count_starts(writer, running));
  MARBLE_ASSIGN_OR_RETURN(auto reader, Database::open(file));
  return std::unique_ptr<JobStore>(
      new JobStore(file, std::move(lock), std::move(running), std::move(writer), std::move(reader), log));
}

Expected<std::string> JobStore::check(const std::string& directory) {
  const std::string file = directory + kFile;
  if (access(file.c_str(), F_OK) != 0) return unexpected(fault(file, std::strerror(errno)));
  MARBLE_ASSIGN_OR_RETURN(auto database, Database::open(file));
  MARBLE_RETURN_IF_ERROR(version_of(database, file));
  MARBLE_ASSIGN_OR_RETURN(const auto whole, database.ask("PRAGMA integrity_check(1)"));
  if (whole != "ok") return unexpected(fault(file, "is damaged: " + whole));
  MARBLE_ASSIGN_OR_RETURN(const auto jobs,
                          database.ask("SELECT count(*) FROM jobs WHERE id NOT IN (SELECT id FROM answers)"));
  MARBLE_ASSIGN_OR_RETURN(const auto answers, database.ask("SELECT count(*) FROM answers"));
  return file + ": ok, " + jobs + " jobs without an answer, " + answers + " with one";
}

Expected<std::vector<StoredJob>> JobStore::unanswered() {
  const MutexLock lock(read_mutex_);
  MARBLE_ASSIGN_OR_RETURN(
      auto rows,
      reader_.prepare(
          "SELECT id, client, request_id, digest, peer, traceparent, priority, accepted_unix_s, cancelled, "
          "length(request), lost, elements FROM jobs WHERE id NOT IN (SELECT id FROM answers) ORDER BY "
          "number"));
  std::vector<StoredJob> jobs;
  while (true) {
    MARBLE_ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row) return jobs;
    jobs.push_back(job_in(rows));
  }
}

Expected<std::string> JobStore::request_of(const std::string& id) {
  const MutexLock lock(read_mutex_);
  MARBLE_ASSIGN_OR_RETURN(auto rows,
                          reader_.prepare("SELECT request FROM jobs WHERE id = ? AND request IS NOT NULL"));
  MARBLE_ASSIGN_OR_RETURN(const auto row, rows.bind(1, id).step());
  if (!row) return unexpected(failure(ErrorCode::not_found, "job_id", id, "has no request that is kept"));
  return rows.bytes(0);
}

Expected<void> JobStore::each_result(const std::function<void(StoredResult)>& report) {
  const MutexLock lock(read_mutex_);
  MARBLE_ASSIGN_OR_RETURN(auto rows, reader_.prepare("SELECT id, client, request_id, digest, job, answer, "
                                                     "error, finished_unix_s, ifnull(length(request), "
                                                     "-1), elements "
                                                     "FROM answers JOIN jobs USING (id) ORDER BY ended"));
  while (true) {
    MARBLE_ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row) return {};
    report(result_in(rows));
  }
}

void JobStore::add(StoredJob job, CompletionCallback settled) {
  changes_.ask({.kind = Kind::add, .job = std::move(job), .settled = std::move(settled)});
}

void JobStore::finish(StoredResult result, CompletionCallback settled) {
  changes_.ask({.kind = Kind::finish, .result = std::move(result), .settled = std::move(settled)});
}

void JobStore::cancel(const std::string& id) { changes_.ask({.kind = Kind::cancel, .job = {.id = id}}); }

void JobStore::forget(const std::string& id) { changes_.ask({.kind = Kind::forget, .job = {.id = id}}); }

void JobStore::forget_request(const std::string& id) {
  changes_.ask({.kind = Kind::forget_request, .job = {.id = id}});
}

void JobStore::when_settled(CompletionCallback settled) { changes_.ask({.settled = std::move(settled)}); }

void JobStore::open_array(StoredJob array, CompletionCallback settled) {
  array.elements = 0;
  add(std::move(array), std::move(settled));
}

void JobStore::add_element(StoredElement element, CompletionCallback settled) {
  changes_.ask({.kind = Kind::add_element, .element = std::move(element), .settled = std::move(settled)});
}

void JobStore::seal_array(const std::string& id, std::int64_t elements, const std::string& digest,
                          CompletionCallback settled) {
  changes_.ask({.kind = Kind::seal,
                .job = {.id = id, .digest = digest, .elements = elements},
                .settled = std::move(settled)});
}

void JobStore::answer_element(ElementAnswer answer, CompletionCallback settled) {
  changes_.ask({.kind = Kind::answer_element, .answer = std::move(answer), .settled = std::move(settled)});
}

Expected<std::string> JobStore::element(const std::string& array, std::int64_t index) {
  const MutexLock lock(read_mutex_);
  return read_element(reader_, array, index);
}

Expected<std::vector<ElementAnswer>> JobStore::answers_after(const std::string& array, std::int64_t after,
                                                             std::int64_t most_bytes) {
  const MutexLock lock(read_mutex_);
  return read_answers(reader_, array, after, most_bytes);
}

Expected<void> JobStore::each_element(const std::string& array,
                                      const std::function<void(const ElementRow&)>& report) {
  const MutexLock lock(read_mutex_);
  return server::each_element(reader_, array, report);
}

StoreUsage JobStore::usage() const {
  StoreUsage usage = changes_.usage();
  for (const char* part : {"", "-wal"}) {
    struct stat facts = {};
    if (stat((file_ + part).c_str(), &facts) == 0) usage.bytes += facts.st_size;
  }
  return usage;
}

// One transaction. A change that fails alone, because it is too large for SQLite, gets its error and is left
// out.
Expected<void> JobStore::write(std::vector<Change>& changes) {
  if (auto begun = writer_.run("BEGIN IMMEDIATE"); !begun) {
    (void)writer_.run("ROLLBACK");  // left open by an exception
    return begun;
  }
  const auto all = [&]() -> Expected<void> {
    for (Change& change : changes) {
      const auto made = make(change);
      if (made) continue;
      if (made.error().code != ErrorCode::resource_exhausted) return made;
      if (const CompletionCallback settled = std::exchange(change.settled, nullptr)) settled(made);
      change.kind = Kind::nothing;
    }
    if (changes.empty()) {  // any write will do
      MARBLE_RETURN_IF_ERROR(writer_.run(std::string("PRAGMA user_version = ") + kVersion));
    }
    fault_point("before_commit");
    return writer_.run("COMMIT");
  };
  auto made = all();
  if (made) fault_point("after_commit");
  if (!made) (void)writer_.run("ROLLBACK");  // fails if SQLite has already done it
  return made;
}

Expected<void> JobStore::make(const Change& change) {
  const auto run = [&](std::string_view sql, const auto& bind) -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(auto statement, writer_.prepare(sql));
    MARBLE_RETURN_IF_ERROR(bind(statement));
    return statement.run();
  };
  const StoredJob& job = change.job;
  const StoredResult& result = change.result;
  switch (change.kind) {
    case Kind::add:
      return run(
          "INSERT INTO jobs (id, client, request_id, digest, peer, traceparent, priority, accepted_unix_s, "
          "cancelled, request, elements) VALUES (?, ?, ?, ?, ?, ?, ?, ?, 0, ?, ?)",
          [&](Statement& statement) -> Expected<void> {
            if (job.elements) statement.bind(10, *job.elements);
            return statement.bind(1, job.id)
                .bind(2, job.client)
                .bind(3, job.request_id)
                .bind_blob(4, job.digest)
                .bind(5, job.peer)
                .bind(6, job.traceparent)
                .bind(7, job.priority)
                .bind(8, job.accepted_unix_s)
                .bind_blob(9, job.request)
                .bound();
          });
    case Kind::finish: {
      // Nothing is kept for a job that was dropped meanwhile.
      auto answered =
          run("INSERT OR IGNORE INTO answers (id, finished_unix_s, job, answer, error) "
              "SELECT ?1, ?2, ?3, ?4, ?5 WHERE EXISTS (SELECT 1 FROM jobs WHERE id = ?1)",
              [&](Statement& statement) -> Expected<void> {
                return statement.bind(1, result.id)
                    .bind(2, result.finished_unix_s)
                    .bind_blob(3, result.job)
                    .bind_blob(4, result.answer)
                    .bind_blob(5, result.error)
                    .bound();
              });
      if (!answered || result.keeps_request) return answered;
      return run("UPDATE jobs SET request = NULL WHERE id = ?",
                 [&](Statement& statement) { return statement.bind(1, result.id).bound(); });
    }
    case Kind::forget_request:
      return run("UPDATE jobs SET request = NULL WHERE id = ?",
                 [&](Statement& statement) { return statement.bind(1, job.id).bound(); });
    case Kind::cancel:
      return run("UPDATE jobs SET cancelled = 1 WHERE id = ?",
                 [&](Statement& statement) { return statement.bind(1, job.id).bound(); });
    case Kind::forget:
      return run("DELETE FROM jobs WHERE id = ?",
                 [&](Statement& statement) { return statement.bind(1, job.id).bound(); });
    case Kind::add_element:
      return server::add_element(writer_, change.element);
    case Kind::seal:
      return server::seal_array(writer_, job.id, *job.elements, job.digest);
    case Kind::answer_element:
      return server::answer_element(writer_, change.answer);
    case Kind::nothing:
      return {};
  }
  return {};
}

}  // namespace marble::server
