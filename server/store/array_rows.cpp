#include "store/array_rows.h"

#include <algorithm>
#include <charconv>

namespace marble::server {
namespace {

template <class Bind>
Expected<void> run(Database& database, std::string_view sql, const Bind& bind) {
  MARBLE_ASSIGN_OR_RETURN(auto statement, database.prepare(sql));
  MARBLE_RETURN_IF_ERROR(bind(statement).bound());
  return statement.run();
}

// Calls `report` for each row.
template <class Bind, class Report>
Expected<void> read(Database& database, std::string_view sql, const Bind& bind, const Report& report) {
  MARBLE_ASSIGN_OR_RETURN(auto rows, database.prepare(sql));
  MARBLE_RETURN_IF_ERROR(bind(rows).bound());
  while (true) {
    MARBLE_ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row || !report(rows)) return {};
  }
}

ElementEnd end_of(std::int64_t number) {
  return number == 1 ? ElementEnd::solved : number == 2 ? ElementEnd::failed : ElementEnd::unsolved;
}

}  // namespace

// `place` is the element's number. `sequence` is the order of the results; null while there is none.
const char* const kArrayTables = R"(
ALTER TABLE jobs ADD COLUMN elements INTEGER;
CREATE TABLE elements (
  number INTEGER PRIMARY KEY,
  job INTEGER NOT NULL REFERENCES jobs (number) ON DELETE CASCADE,
  place INTEGER NOT NULL,
  request BLOB, lost INTEGER NOT NULL DEFAULT 0,
  sequence INTEGER, ended INTEGER, iterations INTEGER, factorizations INTEGER, answer BLOB,
  UNIQUE (job, place));
CREATE UNIQUE INDEX elements_answered ON elements (job, sequence) WHERE sequence IS NOT NULL;
)";

ElementRow element_in(const Statement& row) {
  return {.index = row.integer(0),
          .lost = row.integer(1),
          .request_bytes = row.integer(2),
          .sequence = row.integer(3),
          .answer_bytes = row.integer(4),
          .end = end_of(row.integer(5)),
          .iterations = row.integer(6),
          .factorizations = row.integer(7)};
}

Expected<void> add_element(Database& database, const StoredElement& element) {
  return run(database,
             "INSERT INTO elements (job, place, request) SELECT number, ?2, ?3 FROM jobs WHERE id = ?1",
             [&](Statement& statement) -> Statement& {
               return statement.bind(1, element.array).bind(2, element.index).bind_blob(3, element.request);
             });
}

Expected<void> seal_array(Database& database, const std::string& id, std::int64_t elements,
                          const std::string& digest) {
  auto made = run(database,
                  "UPDATE jobs SET elements = ?2, digest = ?3 WHERE id = ?1"
                  " AND (SELECT count(*) FROM elements WHERE job = jobs.number) = ?2",
                  [&](Statement& statement) -> Statement& {
                    return statement.bind(1, id).bind(2, elements).bind_blob(3, digest);
                  });
  if (!made) return made;
  MARBLE_ASSIGN_OR_RETURN(const auto changed, database.ask("SELECT changes()"));
  if (changed == "1") return {};
  // An error of this array alone: the transaction's other changes are written.
  return unexpected(failure(ErrorCode::resource_exhausted, "not all elements could be written"));
}

// Nothing is kept for an array that was dropped meanwhile. An element whose row was lost gets a row again.
Expected<void> answer_element(Database& database, const ElementAnswer& answer) {
  return run(database,
             "INSERT INTO elements (job, place, sequence, ended, iterations, factorizations, answer)"
             " SELECT number, ?2, (SELECT ifnull(max(sequence), 0) + 1 FROM elements"
             " WHERE job = jobs.number AND sequence IS NOT NULL), ?3, ?4, ?5, ?6 FROM jobs WHERE id = ?1"
             " ON CONFLICT (job, place) DO UPDATE SET request = NULL, sequence = excluded.sequence,"
             " ended = excluded.ended, iterations = excluded.iterations,"
             " factorizations = excluded.factorizations, answer = excluded.answer"
             " WHERE elements.sequence IS NULL",
             [&](Statement& statement) -> Statement& {
               return statement.bind(1, answer.array)
                   .bind(2, answer.index)
                   .bind(3, static_cast<std::int64_t>(answer.end))
                   .bind(4, answer.iterations)
                   .bind(5, answer.factorizations)
                   .bind_blob(6, answer.message);
             });
}

Expected<void> count_element_starts(Database& database, const JobStart& start) {
  const std::size_t dot = start.id.find('.');
  if (dot == std::string::npos) return {};
  std::int64_t index = -1;
  std::from_chars(start.id.data() + dot + 1, start.id.data() + start.id.size(), index);
  return run(database,
             "UPDATE elements SET lost = max(lost, ?3) WHERE place = ?2"
             " AND job = (SELECT number FROM jobs WHERE id = ?1)",
             [&, array = start.id.substr(0, dot)](Statement& statement) -> Statement& {
               return statement.bind(1, array).bind(2, index).bind(3, std::int64_t{start.number});
             });
}

Expected<std::string> read_element(Database& database, const std::string& array, std::int64_t index) {
  Expected<std::string> found =
      unexpected(failure(ErrorCode::not_found, "element", std::to_string(index), "is not in the store"));
  auto done = read(
      database,
      "SELECT request FROM elements WHERE job = (SELECT number FROM jobs WHERE id = ?1) AND place = ?2"
      " AND request IS NOT NULL",
      [&](Statement& statement) -> Statement& { return statement.bind(1, array).bind(2, index); },
      [&](const Statement& row) {
        found = row.bytes(0);
        return false;
      });
  return done ? found : unexpected(done.error());
}

Expected<std::vector<ElementAnswer>> read_answers(Database& database, const std::string& array,
                                                  std::int64_t after, std::int64_t most_bytes) {
  std::vector<ElementAnswer> answers;
  std::int64_t bytes = 0;
  auto done = read(
      database,
      "SELECT sequence, place, ended, answer FROM elements"
      " WHERE job = (SELECT number FROM jobs WHERE id = ?1) AND sequence IS NOT NULL AND sequence > ?2"
      " ORDER BY sequence",
      [&](Statement& statement) -> Statement& { return statement.bind(1, array).bind(2, after); },
      [&](const Statement& row) {
        answers.push_back({.array = array,
                           .index = row.integer(1),
                           .sequence = row.integer(0),
                           .end = end_of(row.integer(2)),
                           .message = row.bytes(3)});
        bytes += static_cast<std::int64_t>(answers.back().message.size()) + 1;
        return bytes < most_bytes;
      });
  if (!done) return unexpected(done.error());
  return answers;
}

Expected<void> each_element(Database& database, const std::string& array,
                            const std::function<void(const ElementRow&)>& report) {
  return read(
      database,
      "SELECT place, lost, ifnull(length(request), 0), ifnull(sequence, 0), ifnull(length(answer), 0),"
      " ended, iterations, factorizations FROM elements"
      " WHERE job = (SELECT number FROM jobs WHERE id = ?1) ORDER BY place",
      [&](Statement& statement) -> Statement& { return statement.bind(1, array); },
      [&](const Statement& row) {
        report(element_in(row));
        return true;
      });
}

}  // namespace marble::server
