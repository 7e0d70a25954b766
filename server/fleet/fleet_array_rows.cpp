// FleetStore: the rows of arrays.
#include <algorithm>

#include "fleet/fleet_array_statements.h"
#include "fleet/fleet_store.h"

namespace marble::server {
namespace {

constexpr std::int64_t kMostStarts = 1'000'000;

std::int64_t positive(std::int64_t number) { return std::max<std::int64_t>(number, 0); }

}  // namespace

StoredElements elements_in(const PgRows& rows, std::int64_t elements) {
  StoredElements stored;
  if (rows.size() == 0) return stored;
  stored.rows = positive(rows.integer(0, 0));
  stored.counts = {.elements = elements,
                   .done = std::clamp<std::int64_t>(rows.integer(0, 1), 0, elements),
                   .solved = std::clamp<std::int64_t>(rows.integer(0, 2), 0, elements),
                   .failed = std::clamp<std::int64_t>(rows.integer(0, 3), 0, elements),
                   .iterations = positive(rows.integer(0, 4)),
                   .factorizations = positive(rows.integer(0, 5))};
  stored.answer_bytes = positive(rows.integer(0, 6));
  stored.request_bytes = positive(rows.integer(0, 7));
  stored.last_sequence = positive(rows.integer(0, 8));
  return stored;
}

void read_claim(const PgRows& rows, ElementClaim& claim) {
  claim.is_held = rows.size() > 0 && rows.integer(0, 0) > 0;
  claim.elements.clear();
  for (int row = 0; row < rows.size(); ++row) {
    if (!rows.truth(row, 1)) continue;
    ClaimedElement element{.index = rows.integer(row, 2),
                           .lost = std::clamp<std::int64_t>(rows.integer(row, 3), 0, kMostStarts)};
    if (rows.truth(row, 4)) element.request = std::string(rows.bytes(row, 5));
    claim.elements.push_back(std::move(element));
  }
}

std::vector<ElementAnswer> answers_in(const PgRows& rows, const std::string& array) {
  std::vector<ElementAnswer> answers;
  for (int row = 0; row < rows.size(); ++row) {
    const std::int64_t end = rows.integer(row, 2);
    answers.push_back({.array = array,
                       .index = rows.integer(row, 1),
                       .sequence = rows.integer(row, 0),
                       .end = end == 1   ? ElementEnd::solved
                              : end == 2 ? ElementEnd::failed
                                         : ElementEnd::unsolved,
                       .message = std::string(rows.bytes(row, 3))});
  }
  return answers;
}

// Of the arrays among the jobs: what the store has of their elements. Each element gets a row again.
Expected<void> FleetStore::count_elements(std::vector<TakenJob>& taken) {
  std::vector<PgStatement> all, lost;
  for (const TakenJob& job : taken) {
    if (!job.stored.elements) continue;
    all.push_back(PgStatement(kUnclaim).number(job.number));
    all.push_back(PgStatement(kElements).number(job.number).number(*job.stored.elements));
  }
  if (all.empty()) return {};
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database_->run(all));
  std::size_t at = 1;
  for (TakenJob& job : taken) {
    if (!job.stored.elements) continue;
    job.elements = elements_in(rows[at], *job.stored.elements);
    at += 2;
    const std::int64_t missing = *job.stored.elements - job.elements.rows;
    if (missing > 0 && missing <= job.elements.rows)
      lost.push_back(PgStatement(kAddLostElements).number(job.number).number(*job.stored.elements));
  }
  if (lost.empty()) return {};
  const auto added = database_->run(lost);
  return added ? Expected<void>() : unexpected(added.error());
}

}  // namespace marble::server
