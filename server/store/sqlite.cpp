#include "store/sqlite.h"

#include <utility>

namespace marble::server {
namespace {

constexpr int kBusyMilliseconds = 5000;  // time for a backup that reads meanwhile

Error fault_of(std::string file, int code, const char* words) {
  const auto kind = code == SQLITE_TOOBIG ? ErrorCode::resource_exhausted : ErrorCode::unavailable;
  return failure(kind, "state_dir", std::move(file), words);
}

// The last error.
Error fault_of(sqlite3* connection) {
  return fault_of(sqlite3_db_filename(connection, "main"), sqlite3_errcode(connection),
                  sqlite3_errmsg(connection));
}

}  // namespace

Expected<Database> Database::open(const std::string& file) {
  Database database;
  sqlite3* connection = nullptr;
  const int code = sqlite3_open_v2(
      file.c_str(), &connection, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
  database.connection_.reset(connection);
  if (code != SQLITE_OK) return unexpected(fault_of(file, code, sqlite3_errstr(code)));
  sqlite3_extended_result_codes(connection, 1);
  sqlite3_busy_timeout(connection, kBusyMilliseconds);
  return database;
}

Expected<void> Database::run(const std::string& sql) {
  if (sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK) return {};
  return unexpected(fault_of(connection_.get()));
}

Expected<Statement> Database::prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(connection_.get(), sql.data(), static_cast<int>(sql.size()), &statement, nullptr) !=
      SQLITE_OK) {
    return unexpected(fault_of(connection_.get()));
  }
  return Statement(statement);
}

Expected<std::string> Database::ask(std::string_view sql) {
  MARBLE_ASSIGN_OR_RETURN(auto statement, prepare(sql));
  MARBLE_ASSIGN_OR_RETURN(const auto row, statement.step());
  return row ? statement.bytes(0) : std::string();
}

Statement& Statement::bind(int at, std::int64_t value) {
  note(sqlite3_bind_int64(statement_.get(), at, value));
  return *this;
}

Statement& Statement::bind(int at, double value) {
  note(sqlite3_bind_double(statement_.get(), at, value));
  return *this;
}

Statement& Statement::bind(int at, std::string_view text) {
  note(sqlite3_bind_text64(statement_.get(), at, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8));
  return *this;
}

Statement& Statement::bind_blob(int at, std::string_view bytes) {
  note(sqlite3_bind_blob64(statement_.get(), at, bytes.data(), bytes.size(), SQLITE_STATIC));
  return *this;
}

Expected<void> Statement::bound() const {
  if (bound_ == SQLITE_OK) return {};
  const char* const file = sqlite3_db_filename(sqlite3_db_handle(statement_.get()), "main");
  return unexpected(fault_of(file, bound_, sqlite3_errstr(bound_)));
}

Expected<bool> Statement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  const Error error = fault_of(sqlite3_db_handle(statement_.get()));
  sqlite3_reset(statement_.get());
  return unexpected(error);
}

Expected<void> Statement::run() {
  const auto row = step();
  sqlite3_reset(statement_.get());
  sqlite3_clear_bindings(statement_.get());
  if (!row) return unexpected(row.error());
  return {};
}

std::string Statement::bytes(int column) const {
  // The pointer first: reading the size must not change the type.
  const void* const start = sqlite3_column_blob(statement_.get(), column);
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column));
  return start == nullptr ? std::string() : std::string(static_cast<const char*>(start), size);
}

}  // namespace marble::server
