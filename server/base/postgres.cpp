#include "base/postgres.h"

#include <endian.h>
#include <poll.h>

#include <array>
#include <bit>
#include <charconv>
#include <cstring>

namespace marble::server {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kBytesPerSecond = 16 << 20;  // of a slow disk; large data get more time

std::string first_line(const char* message) {
  const std::string text = message == nullptr ? "" : message;
  return text.substr(0, text.find('\n'));
}

// 1: ready, 0: not in time.
int wait_on(std::span<pollfd> ends, std::chrono::steady_clock::time_point until) {
  const auto left = std::chrono::ceil<milliseconds>(until - std::chrono::steady_clock::now()).count();
  return poll(ends.data(), ends.size(), static_cast<int>(std::max<std::int64_t>(left, 0)));
}

}  // namespace

std::int64_t PgRows::changed() const {
  const std::string_view text = libpq().PQcmdTuples(result_.get());
  std::int64_t count = 0;
  std::from_chars(text.data(), text.data() + text.size(), count);
  return count;
}

std::string text_array(const std::vector<std::string>& texts) {
  std::string array = "{";
  for (const std::string& text : texts) {
    array += array.size() > 1 ? ",\"" : "\"";
    for (const char c : text) {
      if (c == '"' || c == '\\') array += '\\';
      array += c;
    }
    array += '"';
  }
  return array + "}";
}

std::string_view PgRows::bytes(int row, int column) const {
  return {libpq().PQgetvalue(result_.get(), row, column),
          static_cast<std::size_t>(libpq().PQgetlength(result_.get(), row, column))};
}

std::int64_t PgRows::integer(int row, int column) const {
  std::int64_t value = 0;
  const std::string_view big_endian = bytes(row, column);
  if (big_endian.size() > sizeof value) return 0;
  for (std::size_t i = 0; i < big_endian.size(); ++i) {
    const auto byte = static_cast<std::uint8_t>(big_endian[i]);
    value = i == 0 ? static_cast<std::int8_t>(byte) : value * 256 + byte;
  }
  return value;
}

double PgRows::real(int row, int column) const {
  std::uint64_t bits = 0;
  const std::string_view value = bytes(row, column);
  if (value.size() != sizeof bits) return 0.0;
  std::memcpy(&bits, value.data(), sizeof bits);
  return std::bit_cast<double>(be64toh(bits));
}

PgStatement&& PgStatement::real(double value) && {
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return std::move(*this).add(std::string(text.data(), end), 0);
}

Error Postgres::fault(std::string why) const {
  return failure(ErrorCode::unavailable, "state", where_, std::move(why));
}

Error Postgres::lost(std::string why) {
  connection_ = nullptr;
  state_.clear();
  return fault(std::move(why));
}

Expected<Postgres> Postgres::open(const std::string& uri) {
  if (!libpq().loaded) return unexpected(libpq().loaded.error());
  Postgres opened;
  opened.where_ = uri.substr(0, uri.find('?'));
  // Values in the URI take precedence.
  const std::array names = {"application_name", "client_encoding", "tcp_user_timeout",
                            "keepalives_idle",  "dbname",          static_cast<const char*>(nullptr)};
  const std::array values = {
      "marble-server", "UTF8", "10000", "10", uri.c_str(), static_cast<const char*>(nullptr)};
  opened.connection_.reset(libpq().PQconnectStartParams(names.data(), values.data(), 1));
  PGconn* const connection = opened.connection_.get();
  if (connection == nullptr) return unexpected(opened.fault("no memory"));
  // Notices would otherwise go to the server's standard error.
  libpq().PQsetNoticeProcessor(
      connection, [](void*, const char*) {}, nullptr);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  for (auto step = PGRES_POLLING_WRITING; step != PGRES_POLLING_OK;
       step = libpq().PQconnectPoll(connection)) {
    if (step == PGRES_POLLING_FAILED || libpq().PQstatus(connection) == CONNECTION_BAD)
      return unexpected(opened.lost(first_line(libpq().PQerrorMessage(connection))));
    const short events = step == PGRES_POLLING_READING ? POLLIN : POLLOUT;
    MARBLE_RETURN_IF_ERROR(opened.wait_for(events, end));
  }
  if (libpq().PQsetnonblocking(connection, 1) != 0 || libpq().PQenterPipelineMode(connection) != 1)
    return unexpected(opened.lost(first_line(libpq().PQerrorMessage(connection))));
  // A database without an encoding stores any bytes, and accepts them again only from a client without one.
  const std::array settings = {PgStatement("SELECT set_config('client_encoding', 'SQL_ASCII', false)"
                                           " WHERE getdatabaseencoding() = 'SQL_ASCII'"),
                               PgStatement("SET statement_timeout = '60s'"),
                               PgStatement("SET lock_timeout = '5s'"),
                               PgStatement("SET idle_in_transaction_session_timeout = '10s'")};
  MARBLE_RETURN_IF_ERROR(opened.run(settings));
  return opened;
}

Expected<void> Postgres::wait_for(short events, Time end) {
  std::array ends = {pollfd{libpq().PQsocket(connection_.get()), events, 0}};
  if (wait_on(ends, end) > 0 || std::chrono::steady_clock::now() < end) return {};
  return unexpected(lost("does not answer"));
}

// Null between the results of two statements.
Expected<PGresult*> Postgres::next_result(Time::duration patience) {
  PGconn* const connection = connection_.get();
  while (libpq().PQisBusy(connection) != 0) {
    const int unsent = libpq().PQflush(connection);
    if (unsent < 0) return unexpected(lost(first_line(libpq().PQerrorMessage(connection))));
    const Time end = std::chrono::steady_clock::now() + patience;
    MARBLE_RETURN_IF_ERROR(wait_for(static_cast<short>(unsent > 0 ? POLLIN | POLLOUT : POLLIN), end));
    if (libpq().PQconsumeInput(connection) == 0)
      return unexpected(lost(first_line(libpq().PQerrorMessage(connection))));
  }
  return libpq().PQgetResult(connection);
}

Expected<std::vector<PgRows>> Postgres::run(std::span<const PgStatement> statements) {
  PGconn* const connection = connection_.get();
  if (connection == nullptr) return unexpected(fault("is not connected"));
  std::size_t bytes = 0;
  for (const PgStatement& statement : statements) {
    std::vector<const char*> values;
    std::vector<int> lengths;
    for (const std::string& value : statement.values_) {
      values.push_back(value.data());
      lengths.push_back(static_cast<int>(value.size()));
      bytes += value.size();
    }
    if (libpq().PQsendQueryParams(connection, statement.sql_, static_cast<int>(values.size()), nullptr,
                                  values.data(), lengths.data(), statement.formats_.data(), 1) != 1)
      return unexpected(lost(first_line(libpq().PQerrorMessage(connection))));
  }
  if (libpq().PQpipelineSync(connection) != 1)
    return unexpected(lost(first_line(libpq().PQerrorMessage(connection))));
  std::vector<PgRows> all;
  Expected<void> made;
  const auto patience = kPatience + std::chrono::seconds(bytes / kBytesPerSecond);
  while (true) {
    MARBLE_ASSIGN_OR_RETURN(const auto result, next_result(patience));
    if (result == nullptr) {
      if (libpq().PQstatus(connection) == CONNECTION_BAD)
        return unexpected(lost(first_line(libpq().PQerrorMessage(connection))));
      continue;
    }
    PgRows rows(result);
    const ExecStatusType status = libpq().PQresultStatus(result);
    if (status == PGRES_PIPELINE_SYNC) break;
    if (status == PGRES_TUPLES_OK || status == PGRES_COMMAND_OK) {
      all.push_back(std::move(rows));
    } else if (made && status != PGRES_PIPELINE_ABORTED) {
      const char* state = libpq().PQresultErrorField(result, PG_DIAG_SQLSTATE);
      state_ = state == nullptr ? "" : state;
      made = unexpected(fault(first_line(libpq().PQresultErrorMessage(result))));
      if (state_.empty()) return unexpected(lost(made.error().bound));
    }
  }
  if (!made) return unexpected(made.error());
  return all;
}

Expected<PgRows> Postgres::run(const PgStatement& statement) {
  MARBLE_ASSIGN_OR_RETURN(auto all, run(std::span(&statement, 1)));
  return std::move(all.front());
}

bool Postgres::take_notifications() {
  bool any = false;
  while (PGnotify* const notification = libpq().PQnotifies(connection_.get())) {
    libpq().PQfreemem(notification);
    any = true;
  }
  return any;
}

Expected<bool> Postgres::wait(int descriptor, milliseconds patience) {
  if (connection_ == nullptr) return unexpected(fault("is not connected"));
  if (take_notifications()) return true;
  std::array ends = {pollfd{libpq().PQsocket(connection_.get()), POLLIN, 0}, pollfd{descriptor, POLLIN, 0}};
  if (wait_on(ends, std::chrono::steady_clock::now() + patience) <= 0) return false;
  if (ends[0].revents != 0 && libpq().PQconsumeInput(connection_.get()) == 0)
    return unexpected(lost(first_line(libpq().PQerrorMessage(connection_.get()))));
  return take_notifications();
}

}  // namespace marble::server
