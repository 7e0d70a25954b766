// The SQL that a server writes to the tables of a shared store.
#pragma once

namespace marble::server {

inline constexpr const char* kFinish =
    "WITH done AS (UPDATE marble_jobs SET state = 2, token = '', lease = NULL, ended = clock_timestamp(),"
    " answer_bytes = $3, info = $4, changed = pg_current_xact_id(),"
    " bytes = CASE WHEN elements IS NULL THEN bytes ELSE 0 END"
    " WHERE id = $1 AND token = $2 AND state = 1 RETURNING number, elements),"
    " live AS (DELETE FROM marble_live l USING done WHERE l.number = done.number),"
    " setup AS (DELETE FROM marble_requests r USING done WHERE r.number = done.number AND elements IS NOT "
    "NULL)"
    " INSERT INTO marble_answers SELECT number, $5::bytea, $6::bytea, $7::bytea FROM done";
inline constexpr const char* kRelease =
    "WITH back AS (UPDATE marble_jobs SET state = 0, token = '', lease = NULL, server = '',"
    " changed = pg_current_xact_id() WHERE id = $1 AND token = $2 AND state = 1 RETURNING number),"
    " live AS (DELETE FROM marble_live l USING back WHERE l.number = back.number)"
    " UPDATE marble_elements e SET claimed = 0 FROM back"
    " WHERE e.job = back.number AND e.claimed <> 0 AND e.sequence IS NULL";
inline constexpr const char* kCancel =
    "WITH reported AS (UPDATE marble_jobs SET cancelled = true, changed = pg_current_xact_id(),"
    " state = CASE state WHEN 0 THEN 2 ELSE state END,"
    " ended = CASE state WHEN 0 THEN clock_timestamp() ELSE ended END,"
    " info = CASE state WHEN 0 THEN $2 ELSE info END,"
    " bytes = CASE WHEN state = 0 AND elements IS NOT NULL THEN 0 ELSE bytes END"
    " WHERE id = $1 AND state < 2 RETURNING number, state, elements),"
    " setup AS (DELETE FROM marble_requests r USING reported"
    " WHERE r.number = reported.number AND state = 2 AND elements IS NOT NULL)"
    " INSERT INTO marble_answers SELECT number, ''::bytea, $3::bytea, $4::bytea FROM reported WHERE state = "
    "2";
inline constexpr const char* kForget =
    "WITH gone AS (UPDATE marble_jobs SET state = 3, cancelled = true, ended = clock_timestamp(),"
    " changed = pg_current_xact_id() WHERE id = $1 AND state < 3 RETURNING number),"
    " asked AS (DELETE FROM marble_requests r USING gone WHERE r.number = gone.number),"
    " live AS (DELETE FROM marble_live l USING gone WHERE l.number = gone.number)"
    " DELETE FROM marble_answers a USING gone WHERE a.number = gone.number";
inline constexpr const char* kRenew =
    "UPDATE marble_jobs SET lease = clock_timestamp() + make_interval(secs => $2)"
    " WHERE state IN (1, 4) AND token = ANY ($1::text[]) RETURNING id, cancelled";
inline constexpr const char* kLive =
    "INSERT INTO marble_live SELECT number, $3::bigint, $4::bigint, $5::bytea, $6::bytea, $7::bytea FROM "
    "marble_jobs"
    " WHERE number = $1 AND token = $2 AND state = 1"
    " ON CONFLICT (number) DO UPDATE SET first = excluded.first, upto = excluded.upto, rows = excluded.rows,"
    " info = excluded.info, job = excluded.job";
inline constexpr const char* kTakeOver =
    "WITH late AS (SELECT number FROM marble_jobs WHERE state = 1"
    " AND (lease IS NULL OR lease < clock_timestamp() OR lease > clock_timestamp() + interval '1 day')"
    " ORDER BY number FOR UPDATE SKIP LOCKED),"
    " back AS (UPDATE marble_jobs j SET state = 0, token = '', lease = NULL,"
    " lost = CASE WHEN elements IS NULL THEN least(lost, 1000000) + 1 ELSE 0 END,"
    " changed = pg_current_xact_id() FROM late WHERE j.number = late.number RETURNING j.number, id, server),"
    " live AS (DELETE FROM marble_live l USING back WHERE l.number = back.number),"
    " begun AS (UPDATE marble_elements e SET claimed = 0, lost = least(greatest(e.lost, 0), 1000000) + 1"
    " FROM back WHERE e.job = back.number AND e.claimed <> 0 AND e.sequence IS NULL)"
    " SELECT id, server FROM back";
inline constexpr const char* kLines =
    "SELECT l.client, l.priority, waiting, running, bytes, coalesce(turn, 0), suspect, drafts FROM ("
    "SELECT client, priority, lost > 0 AND lost < $1 AS suspect, count(*) FILTER (WHERE state = 0) AS "
    "waiting,"
    " count(*) FILTER (WHERE state = 1) AS running, count(*) FILTER (WHERE state = 4) AS drafts,"
    " sum(least(greatest(bytes, 0), 1099511627776))::bigint AS bytes"
    " FROM marble_jobs WHERE state IN (0, 1, 4) GROUP BY client, priority, suspect) l"
    " LEFT JOIN marble_turns t ON t.client = l.client AND t.priority = l.priority";
inline constexpr const char* kAdd =
    "WITH job AS (INSERT INTO marble_jobs"
    " (id, client, request_id, digest, peer, traceparent, priority, bytes, info)"
    " VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9) RETURNING number)"
    " INSERT INTO marble_requests SELECT number, $10::bytea FROM job";
inline constexpr const char* kTake =
    "WITH chosen AS (SELECT number FROM marble_jobs WHERE state = 0 AND client = $1 AND priority = $2"
    " AND (lost > 0 AND lost < $7) = $8 ORDER BY number LIMIT $3 FOR UPDATE SKIP LOCKED),"
    " took AS (UPDATE marble_jobs j SET state = 1, server = $4, token = $5::text || j.number::text,"
    " lease = clock_timestamp() + make_interval(secs => $6), changed = pg_current_xact_id()"
    " FROM chosen WHERE j.number = chosen.number RETURNING j.*)"
    " SELECT took.number, id, client, request_id, peer, traceparent, priority,"
    " extract(epoch FROM accepted)::float8, (extract(epoch FROM clock_timestamp()) - extract(epoch FROM "
    "accepted))::float8,"
    " cancelled, lost, token, info, request, coalesce(elements, 0) FROM took LEFT JOIN marble_requests USING "
    "(number) ORDER BY "
    "number";
inline constexpr const char* kTurn =
    "INSERT INTO marble_turns VALUES ($1, $2, nextval('marble_turn'))"
    " ON CONFLICT (client, priority) DO UPDATE SET turn = excluded.turn";

}  // namespace marble::server
