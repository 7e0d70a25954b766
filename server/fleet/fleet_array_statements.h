// The SQL for arrays in a shared store.
#pragma once

namespace marble::server {

// An array that is being received.
inline constexpr const char* kOpenArray =
    "WITH draft AS (INSERT INTO marble_jobs (id, client, request_id, digest, peer, traceparent, priority,"
    " bytes, info, elements, state, token, lease) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, 0, 4, $11,"
    " clock_timestamp() + make_interval(secs => $12)) RETURNING number)"
    " INSERT INTO marble_requests SELECT number, $10::bytea FROM draft";
inline constexpr const char* kAddElement =
    "INSERT INTO marble_elements (job, place, request) SELECT number, $3, $4::bytea FROM marble_jobs"
    " WHERE id = $1 AND token = $2 AND state = 4 ON CONFLICT DO NOTHING";
inline constexpr const char* kAddBytes =
    "UPDATE marble_jobs SET bytes = bytes + $2 WHERE id = $1 AND state = 4";
inline constexpr const char* kSealArray =
    "UPDATE marble_jobs SET state = 0, token = '', lease = NULL, elements = $3, digest = $4, info = $5,"
    " accepted = clock_timestamp(), changed = pg_current_xact_id()"
    " WHERE id = $1 AND token = $2 AND state = 4"
    " AND (SELECT count(*) FROM marble_elements WHERE job = number) = $3 RETURNING id";
inline constexpr const char* kDropArray =
    "UPDATE marble_jobs SET state = 3, ended = clock_timestamp() WHERE id = $1 AND token = $2 AND state = 4";
inline constexpr const char* kDropLateArrays =
    "UPDATE marble_jobs SET state = 3, ended = clock_timestamp() WHERE state = 4"
    " AND (lease IS NULL OR lease < clock_timestamp() OR lease > clock_timestamp() + interval '1 day')";

// An array that a server has taken.
inline constexpr const char* kUnclaim =
    "UPDATE marble_elements SET claimed = 0 WHERE job = $1 AND claimed <> 0 AND sequence IS NULL";
inline constexpr const char* kElements =
    "SELECT count(*), count(sequence), count(sequence) FILTER (WHERE ended = 1),"
    " count(sequence) FILTER (WHERE ended = 2),"
    " coalesce(sum(least(greatest(iterations, 0), 1000000000000)), 0)::bigint,"
    " coalesce(sum(least(greatest(factorizations, 0), 1000000000000)), 0)::bigint,"
    " coalesce(sum(octet_length(answer)), 0)::bigint,"
    " coalesce(sum(octet_length(request)), 0)::bigint, coalesce(max(sequence), 0)"
    " FROM marble_elements WHERE job = $1 AND place >= 0 AND place < $2";
// Rows that were lost: each element gets a result.
inline constexpr const char* kAddLostElements =
    "INSERT INTO marble_elements (job, place) SELECT $1::bigint, place FROM generate_series(0, $2::bigint - "
    "1) place"
    " ON CONFLICT DO NOTHING";
// The same elements if this claim has been made before, and its reply was lost. The first column shows
// whether the array is still this server's. The last suspects come first: they were probably claimed without
// having begun, and do not wait for one that takes long.
inline constexpr const char* kClaim =
    "WITH held AS (SELECT number FROM marble_jobs WHERE id = $1 AND token = $2 AND state = 1 FOR SHARE),"
    " mine AS (SELECT job, place, coalesce(octet_length(request), 0) AS size FROM marble_elements"
    " JOIN held ON job = number WHERE sequence IS NULL AND claimed <> 0 AND claimed = $3),"
    " free AS ((SELECT job, place, coalesce(octet_length(request), 0) AS size FROM marble_elements"
    " JOIN held ON job = number WHERE sequence IS NULL AND claimed = 0 AND lost > 0 AND lost < $5"
    " AND $4::boolean ORDER BY place DESC LIMIT 1)"
    " UNION ALL (SELECT job, place, coalesce(octet_length(request), 0) FROM marble_elements"
    " JOIN held ON job = number WHERE sequence IS NULL AND claimed = 0 AND NOT (lost > 0 AND lost < $5)"
    " AND NOT $4::boolean ORDER BY place LIMIT $6)),"
    " chosen AS (SELECT * FROM mine UNION ALL SELECT * FROM free WHERE NOT EXISTS (SELECT 1 FROM mine)),"
    " sized AS (SELECT job, place, sum(size) OVER (ORDER BY place) - size AS before FROM chosen),"
    " took AS (UPDATE marble_elements e SET claimed = $3 FROM sized"
    " WHERE e.job = sized.job AND e.place = sized.place AND before < $7 RETURNING e.place, e.lost, e.request)"
    " SELECT (SELECT count(*) FROM held), place IS NOT NULL, place, lost, request IS NOT NULL, request"
    " FROM (VALUES (1)) one LEFT JOIN took ON true ORDER BY place";
inline constexpr const char* kAnswerElement =
    "WITH held AS (SELECT number FROM marble_jobs WHERE id = $1 AND token = $2 AND state = 1 FOR SHARE)"
    " INSERT INTO marble_elements AS e (job, place, sequence, ended, iterations, factorizations, answer)"
    " SELECT number, $3::bigint, (SELECT least(coalesce(max(sequence), 0), 1000000000000) + 1"
    " FROM marble_elements WHERE job = number AND sequence IS NOT NULL),"
    " $4::smallint, $5::bigint, $6::bigint, $7::bytea FROM held"
    " ON CONFLICT (job, place) DO UPDATE SET request = NULL, claimed = 0, sequence = excluded.sequence,"
    " ended = excluded.ended, iterations = excluded.iterations, factorizations = excluded.factorizations,"
    " answer = excluded.answer WHERE e.sequence IS NULL";
inline constexpr const char* kArraySizes =
    "UPDATE marble_jobs SET bytes = $3, answer_bytes = $4 WHERE number = $1 AND token = $2 AND state = 1";

// For readers.
inline constexpr const char* kFindArray =
    "SELECT client, elements FROM marble_jobs WHERE id = $1 AND elements IS NOT NULL AND state < 3";
inline constexpr const char* kArrayState =
    "SELECT state = 2, coalesce(error, ''::bytea) FROM marble_jobs LEFT JOIN marble_answers USING (number)"
    " WHERE id = $1 AND elements IS NOT NULL AND state < 3";
inline constexpr const char* kArrayAnswers =
    "SELECT sequence, place, ended, answer FROM (SELECT sequence, place, ended, answer,"
    " sum(size) OVER (ORDER BY sequence) - size AS before"
    " FROM (SELECT sequence, place, ended, answer, coalesce(octet_length(answer), 0) + 1 AS size"
    " FROM marble_elements"
    " WHERE job = (SELECT number FROM marble_jobs WHERE id = $1) AND sequence > $2"
    " ORDER BY sequence LIMIT 1000) page) sized WHERE before < $3 ORDER BY sequence";

// Rows of arrays that are gone, and of elements without a result in arrays that have ended; a limited number,
// so that no transaction is long.
inline constexpr const char* kCleanElements =
    "DELETE FROM marble_elements WHERE (job, place) IN (SELECT job, place FROM marble_jobs"
    " JOIN marble_elements ON job = number WHERE state = 3 AND elements IS NOT NULL LIMIT 20000)";
inline constexpr const char* kCleanOpenElements =
    "DELETE FROM marble_elements WHERE (job, place) IN (SELECT job, place FROM marble_jobs"
    " JOIN marble_elements ON job = number WHERE state = 2 AND elements IS NOT NULL AND sequence IS NULL"
    " AND claimed = 0 LIMIT 20000)";
inline constexpr const char* kCleanClaimedElements =
    "DELETE FROM marble_elements WHERE (job, place) IN (SELECT job, place FROM marble_jobs"
    " JOIN marble_elements ON job = number WHERE state = 2 AND elements IS NOT NULL AND sequence IS NULL"
    " AND claimed <> 0)";

}  // namespace marble::server
