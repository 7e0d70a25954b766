// Bytes as the columns of a stored job's row, of SQLite in any types and of PostgreSQL in any lengths: the
// job that they become can be shown, or is an error; so are its answer and its request.
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/fleet_store.h"
#include "fuzz/expect.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "server/idle_parts.h"
#include "service/admission.h"
#include "service/job_message.h"
#include "service/stored_job.h"
#include "submissions/array_setup.h"

namespace {

using namespace marble;
using namespace marble::server;

constexpr int kColumns = 14;
constexpr int kLongestRow = 15;  // the last column repeats an earlier one
using Columns = std::array<std::string_view, kColumns>;

// Each begins with its length in two bytes; the last holds the rest.
Columns columns_of(std::string_view bytes) {
  Columns columns;
  for (std::string_view& column : columns) {
    if (bytes.size() < 2) break;
    const std::size_t length =
        static_cast<std::uint8_t>(bytes[0]) + 256U * static_cast<std::uint8_t>(bytes[1]);
    bytes.remove_prefix(2);
    column = bytes.substr(0, &column == &columns.back() ? bytes.size() : length);
    bytes.remove_prefix(column.size());
  }
  return columns;
}

template <class Number>
Number number_in(std::string_view bytes) {
  Number number = {};
  if (!bytes.empty()) std::memcpy(&number, bytes.data(), std::min(bytes.size(), sizeof number));
  return number;
}

// Two bits a column choose its type.
Statement row_of_sqlite(const Columns& columns, std::uint32_t types) {
  static auto database = Database::open(":memory:");
  FUZZ_EXPECT(database);
  auto row = database->prepare("SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11");
  FUZZ_EXPECT(row);
  for (int at = 0; at < 11; ++at, types >>= 2U) {
    const std::string_view column = columns[static_cast<std::size_t>(at)];
    switch (types & 3U) {
      case 0:
        row->bind(at + 1, column);
        break;
      case 1:
        row->bind_blob(at + 1, column);
        break;
      case 2:
        row->bind(at + 1, number_in<std::int64_t>(column));
        break;
      default:
        row->bind(at + 1, number_in<double>(column));
    }
  }
  FUZZ_EXPECT(row->bound());
  FUZZ_EXPECT(row->step().value_or(false));
  return std::move(*row);
}

PgRows row_of_postgres(const Columns& columns) {
  std::array<std::string, kLongestRow> names;
  std::array<PGresAttDesc, kLongestRow> attributes = {};
  for (std::size_t at = 0; at < kLongestRow; ++at) attributes[at].name = names[at].data();
  PGresult* const result = PQmakeEmptyPGresult(nullptr, PGRES_TUPLES_OK);
  FUZZ_EXPECT(PQsetResultAttrs(result, kLongestRow, attributes.data()) == 1);
  for (std::size_t at = 0; at < kLongestRow; ++at) {
    std::string column(columns[at < kColumns ? at : 0]);
    FUZZ_EXPECT(PQsetvalue(result, 0, static_cast<int>(at), column.data(), static_cast<int>(column.size())) ==
                1);
  }
  return PgRows(result);
}

void expect_shown(const JobRecord& record) {
  v1::GetJobResponse message, again;
  to_message(record, &message);
  const std::string bytes = message.SerializeAsString();
  FUZZ_EXPECT(again.ParseFromString(bytes));
  FUZZ_EXPECT(again.SerializeAsString() == bytes);
}

// As Recovery and FleetSubmissions do.
void take(const ServiceParts& parts, const StoredJob& stored, std::string_view info, int lost) {
  JobDescription what = description_of(stored, info);
  FUZZ_EXPECT(what.id == stored.id && what.client == stored.client);
  FUZZ_EXPECT(what.kind == (stored.elements ? JobKind::array : JobKind::submitted));
  what.trace = parse_traceparent(stored.traceparent, "0123456789abcdef");
  const auto record = parts.board.make(std::move(what), Options());
  JobSnapshot snapshot = stored_snapshot(info);
  snapshot.state = JobState::queued;
  record->restore(std::move(snapshot), {});
  expect_shown(*record);
  const auto request = stored_request(stored.request);
  if (!request) {
    FUZZ_EXPECT(request.error().code == ErrorCode::internal);
  } else {
    (*request)->set_priority(to_message(priority_of(stored.priority)));
    const Caller caller{
        .identity = {.client = stored.client, .roles = {}},
        .origin = {.peer = stored.peer, .client = stored.client, .request_id = stored.request_id},
        .earlier = Caller::Earlier{stored.id, time_of(stored.accepted_unix_s), record}};
    const auto job = make_job(parts, caller, JobKind::submitted, *request);
    if (!job) FUZZ_EXPECT(!job.error().message().empty());
  }
  record->finished(unexpected(set_aside(lost)), 0.0, 0.0);
  expect_shown(*record);
}

void answer(const ServiceParts& parts, const StoredResult& stored) {
  expect_shown(*stored_record(parts.board, stored));
  const ResultStore::Result result = stored_answer(stored.answer, stored.error);
  if (!result.answer) {
    FUZZ_EXPECT(!result.answer.error().message().empty());
    return;
  }
  FUZZ_EXPECT(v1::SolveResponse().ParseFromString(stored.answer));
}

// An array's set-up, and one of its elements.
void take_array(const ServiceParts& parts, const std::string& setup, const std::string& element) {
  v1::ArraySetup message;
  v1::ArrayElement one;
  if (!message.ParseFromString(setup) || !one.ParseFromString(element)) return;
  const Caller caller{.identity = {.client = "array", .roles = {}},
                      .origin = {.peer = "", .client = "array", .request_id = ""}};
  const auto checked = ArraySetup::check(parts, caller, message);
  if (!checked) {
    FUZZ_EXPECT(!checked.error().message().empty());
    return;
  }
  expect_shown(*(*checked)->record());
  if (const auto request = (*checked)->request(std::move(one)); !request)
    FUZZ_EXPECT(!of_element(0, request.error()).message().empty());
}

// The rows of an array in PostgreSQL.
void read_elements(const ServiceParts& parts, const PgRows& row, std::string_view setup) {
  constexpr std::int64_t kElements = 10;
  const StoredElements elements = elements_in(row, kElements);
  FUZZ_EXPECT(elements.rows >= 0 && elements.request_bytes >= 0 && elements.answer_bytes >= 0);
  FUZZ_EXPECT(elements.counts.done >= 0 && elements.counts.done <= kElements);
  ElementClaim claim;
  read_claim(row, claim);
  for (const ClaimedElement& element : claim.elements) {
    FUZZ_EXPECT(element.lost >= 0);
    if (element.request) take_array(parts, std::string(setup), *element.request);
  }
  for (const ElementAnswer& one : answers_in(row, "array"))
    FUZZ_EXPECT(one.end >= ElementEnd::unsolved && one.end <= ElementEnd::failed);
}

// Rows of a job that another server runs.
void follow(const ServiceParts& parts, std::string_view rows, std::string_view info) {
  const auto record = parts.board.make({.id = "followed"}, Options());
  v1::JobEvent event;
  (void)event.ParseFromArray(rows.data(), static_cast<int>(rows.size()));
  std::vector<Progress> progress;
  for (const v1::Progress& row : event.rows()) progress.push_back(progress_of(row));
  record->follow(static_cast<std::int64_t>(progress.size()), progress);
  record->restore(stored_snapshot(info), {});
  expect_shown(*record);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const google::protobuf::LogSilencer silence;
  static const auto idle = std::make_unique<IdleParts>();
  const ServiceParts& parts = idle->all;
  if (size < 4) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto types = number_in<std::uint32_t>(bytes.substr(0, 4));
  const Columns columns = columns_of(bytes.substr(4));
  {
    const Statement row = row_of_sqlite(columns, types);
    StoredJob job = job_in(row);
    job.request = columns.back();
    take(parts, job, "", static_cast<int>(std::min<std::int64_t>(job.lost, 1000)));
    answer(parts, result_in(row));
    const ElementRow element = element_in(row);
    FUZZ_EXPECT(element.end >= ElementEnd::unsolved && element.end <= ElementEnd::failed);
  }
  const PgRows row = row_of_postgres(columns);
  const TakenJob taken = taken_in(row, 0);
  FUZZ_EXPECT(taken.age_s >= 0.0 && taken.lost >= 0);
  take(parts, taken.stored, taken.info, taken.lost);
  answer(parts, {.id = taken.stored.id,
                 .client = taken.stored.client,
                 .job = taken.info,
                 .answer = taken.stored.request,
                 .error = taken.token});
  follow(parts, columns[4], columns[5]);
  read_elements(parts, row, columns.back());
  return 0;
}
