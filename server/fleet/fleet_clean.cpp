// FleetStore: removing what is no longer kept.
#include "fleet/fleet_array_statements.h"
#include "fleet/fleet_store.h"

namespace marble::server {

// Removes expired results, and those beyond the limits; one server at a time.
Expected<void> FleetStore::clean() {
  MARBLE_ASSIGN_OR_RETURN(const auto first,
                          database_->run("SELECT pg_try_advisory_xact_lock(hashtext('marble_clean'))"));
  if (!first.truth(0, 0)) return {};
  std::vector<PgStatement> all;
  // Repairs values that no server writes, and with which no server would take the job.
  all.emplace_back(
      "UPDATE marble_jobs SET priority = least(greatest(priority, 0), 2), state = greatest(state, 0),"
      " changed = pg_current_xact_id() WHERE state < 2 AND (state < 0 OR priority NOT BETWEEN 0 AND 2)");
  all.push_back(
      PgStatement(
          "UPDATE marble_jobs SET state = 3, ended = clock_timestamp(),"
          " changed = pg_current_xact_id()"
          " WHERE state = 2 AND (ended IS NULL OR ended < clock_timestamp() - make_interval(secs => $1)"
          " OR ended > clock_timestamp() + interval '1 day')")
          .real(limits_.keep_s));
  all.push_back(
      PgStatement("UPDATE marble_jobs SET state = 3, ended = clock_timestamp(),"
                  " changed = pg_current_xact_id() WHERE number IN (SELECT number FROM ("
                  "SELECT number, sum(answer_bytes) OVER (ORDER BY ended DESC, number DESC)"
                  " + (SELECT coalesce(sum(answer_bytes), 0) FROM marble_jobs WHERE state < 2) AS upto"
                  " FROM marble_jobs WHERE state = 2) kept WHERE upto > $1)")
          .number(limits_.answer_bytes));
  all.emplace_back(
      "DELETE FROM marble_answers USING marble_jobs j WHERE j.state = 3"
      " AND marble_answers.number = j.number");
  // Requests of jobs with a result use the space that results leave.
  all.push_back(
      PgStatement("DELETE FROM marble_requests USING (SELECT number,"
                  " sum(bytes) OVER (ORDER BY ended DESC, number DESC) + sum(answer_bytes) OVER () AS upto"
                  " FROM marble_jobs WHERE state = 2) kept"
                  " WHERE marble_requests.number = kept.number AND upto > $1")
          .number(limits_.keeps_requests ? limits_.answer_bytes : -1));
  all.emplace_back(
      "DELETE FROM marble_requests USING marble_jobs j WHERE j.state = 3 AND marble_requests.number = "
      "j.number");
  all.emplace_back(kCleanElements);
  all.emplace_back(kCleanOpenElements);
  all.emplace_back(kCleanClaimedElements);
  all.emplace_back(
      "DELETE FROM marble_jobs WHERE state >= 3 AND ended < clock_timestamp() - interval '10 min'");
  all.emplace_back(
      "SELECT sum(pg_total_relation_size(c.oid))::bigint FROM pg_class c"
      " WHERE c.relkind = 'r' AND c.relname LIKE 'marble\\_%'"
      " AND pg_table_is_visible(c.oid)");
  MARBLE_ASSIGN_OR_RETURN(const auto cleaned, database_->run(all));
  bytes_ = cleaned.back().integer(0, 0);
  return {};
}

}  // namespace marble::server
