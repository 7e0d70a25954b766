#include "fleet/fleet_schema.h"

#include <array>

namespace marble::server {
namespace {

constexpr std::int64_t kVersionOfTables = 2;

// `number` is the order of acceptance. `changed` is the transaction that changed the row last, by which each
// server finds new changes. `token` is new whenever a server takes the job: only its holder may write a
// result (a fencing token). `lost` counts the servers that died while running it. Rows of gone jobs stay for
// a while, so that all servers read the change. Large columns are in separate tables, because a row is
// rewritten with each change of its state.
//
// An array has `elements`, and is received in a state of its own. `place` is an element's number, `claimed`
// the number of the claim by which the array's server may run it, or 0. `sequence` is the order of the
// results.
constexpr std::array kMake = {
    "CREATE TABLE marble_schema (version integer NOT NULL)",
    "INSERT INTO marble_schema VALUES (2)",
    "CREATE TABLE marble_jobs ("
    " number bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, id text NOT NULL UNIQUE,"
    " client text NOT NULL, request_id text NOT NULL, digest bytea NOT NULL,"
    " peer text NOT NULL, traceparent text NOT NULL, priority smallint NOT NULL, bytes bigint NOT NULL,"
    " accepted timestamptz NOT NULL DEFAULT clock_timestamp(), cancelled boolean NOT NULL DEFAULT false,"
    " state smallint NOT NULL DEFAULT 0, server text NOT NULL DEFAULT '', token text NOT NULL DEFAULT '',"
    " lease timestamptz, lost integer NOT NULL DEFAULT 0,"
    " ended timestamptz, answer_bytes bigint NOT NULL DEFAULT 0,"
    " info bytea NOT NULL, changed xid8 NOT NULL DEFAULT pg_current_xact_id(), elements bigint)",
    "CREATE UNIQUE INDEX marble_jobs_request ON marble_jobs (client, request_id)"
    " WHERE request_id <> '' AND state < 3",
    "CREATE INDEX marble_jobs_line ON marble_jobs (client, priority, number) WHERE state = 0",
    "CREATE INDEX marble_jobs_load ON marble_jobs (client, priority) INCLUDE (state, bytes, lost)"
    " WHERE state IN (0, 1, 4)",
    "CREATE INDEX marble_jobs_lease ON marble_jobs (lease) WHERE state IN (1, 4)",
    "CREATE INDEX marble_jobs_ended ON marble_jobs (ended, number) INCLUDE (answer_bytes, bytes) WHERE state "
    ">= 2",
    "CREATE INDEX marble_jobs_changed ON marble_jobs (changed)",
    "CREATE TABLE marble_requests ("
    " number bigint PRIMARY KEY REFERENCES marble_jobs ON DELETE CASCADE, request bytea NOT NULL)",
    "ALTER TABLE marble_requests ALTER request SET STORAGE EXTERNAL",
    "CREATE TABLE marble_answers ("
    " number bigint PRIMARY KEY REFERENCES marble_jobs ON DELETE CASCADE,"
    " answer bytea NOT NULL, error bytea NOT NULL, job bytea NOT NULL)",
    "ALTER TABLE marble_answers ALTER answer SET STORAGE EXTERNAL",
    "CREATE TABLE marble_elements ("
    " job bigint REFERENCES marble_jobs ON DELETE CASCADE, place bigint, request bytea,"
    " claimed bigint NOT NULL DEFAULT 0, lost bigint NOT NULL DEFAULT 0,"
    " sequence bigint, ended smallint, iterations bigint, factorizations bigint, answer bytea,"
    " PRIMARY KEY (job, place))",
    "ALTER TABLE marble_elements ALTER request SET STORAGE EXTERNAL, ALTER answer SET STORAGE EXTERNAL",
    "CREATE INDEX marble_elements_open ON marble_elements (job, place) WHERE sequence IS NULL AND claimed = "
    "0",
    "CREATE INDEX marble_elements_suspect ON marble_elements (job, place)"
    " WHERE sequence IS NULL AND claimed = 0 AND lost > 0",
    "CREATE INDEX marble_elements_claimed ON marble_elements (job) WHERE sequence IS NULL AND claimed <> 0",
    "CREATE INDEX marble_elements_answered ON marble_elements (job, sequence) WHERE sequence IS NOT NULL",
    // The state of running jobs, several times a second: a crash of the database may lose it.
    "CREATE UNLOGGED TABLE marble_live ("
    " number bigint PRIMARY KEY REFERENCES marble_jobs ON DELETE CASCADE,"
    " first bigint NOT NULL, upto bigint NOT NULL, rows bytea NOT NULL, info bytea NOT NULL, job bytea NOT "
    "NULL)",
    "CREATE TABLE marble_turns ("
    " client text, priority smallint, turn bigint NOT NULL, PRIMARY KEY (client, priority))",
    "CREATE SEQUENCE marble_turn",
};

// Accepts a database without tables.
Expected<void> check_version(Postgres& database, bool& there) {
  MARBLE_ASSIGN_OR_RETURN(const auto found, database.run("SELECT to_regclass('marble_schema') IS NOT NULL"));
  there = found.truth(0, 0);
  if (!there) return {};
  MARBLE_ASSIGN_OR_RETURN(const auto version, database.run("SELECT version FROM marble_schema"));
  const std::int64_t number = version.size() == 1 ? version.integer(0, 0) : 0;
  if (number == kVersionOfTables) return {};
  return unexpected(failure(
      ErrorCode::failed_precondition, "state", "marble_schema",
      "is of version " + std::to_string(number) + ", this server knows " + std::to_string(kVersionOfTables)));
}

}  // namespace

Expected<void> prepare_fleet(Postgres& database) {
  bool there = false;
  if (auto known = check_version(database, there); !known || there) return known;
  const std::array begin = {PgStatement("BEGIN"),
                            PgStatement("SELECT pg_advisory_xact_lock(hashtext('marble_schema'))")};
  MARBLE_RETURN_IF_ERROR(database.run(begin));
  auto made = check_version(database, there);
  if (made && !there) {
    const std::vector<PgStatement> make(kMake.begin(), kMake.end());
    if (auto tables = database.run(make); !tables) made = unexpected(tables.error());
  }
  const auto ended = database.run(made ? "COMMIT" : "ROLLBACK");
  if (made && !ended) return unexpected(ended.error());
  return made;
}

Expected<std::string> check_fleet(const std::string& uri) {
  MARBLE_ASSIGN_OR_RETURN(auto database, Postgres::open(uri));
  bool there = false;
  MARBLE_RETURN_IF_ERROR(check_version(database, there));
  if (!there) return "no tables yet: the first server makes them";
  const auto counts = database.run(
      "SELECT count(*) FILTER (WHERE state < 2), count(*) FILTER (WHERE state = 2), "
      "count(*) FILTER (WHERE state = 1), count(DISTINCT server) FILTER (WHERE state = 1) FROM marble_jobs");
  if (!counts) return unexpected(counts.error());
  const auto count = [&](int column) { return std::to_string(counts->integer(0, column)); };
  return "ok, " + count(0) + " jobs without an answer, " + count(1) + " with one; " + count(2) + " run, on " +
         count(3) + " servers";
}

}  // namespace marble::server
