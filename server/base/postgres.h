// PostgreSQL as values: a connection that closes itself, statements with a bounded wait, and errors in
// PostgreSQL's own words.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/libpq.h"
#include "marble/error.h"

namespace marble::server {

/// The result of a statement. Columns are numbered from 0; their types must be the requested ones.
class PgRows {
 public:
  explicit PgRows(PGresult* result) : result_(result) {}

  [[nodiscard]] int size() const { return libpq().PQntuples(result_.get()); }
  /// Returns the number of rows that a statement changed.
  [[nodiscard]] std::int64_t changed() const;
  /// smallint, int or bigint.
  [[nodiscard]] std::int64_t integer(int row, int column) const;
  /// double precision.
  [[nodiscard]] double real(int row, int column) const;
  [[nodiscard]] bool truth(int row, int column) const { return bytes(row, column) == std::string_view("\1"); }
  /// text or bytea; empty if it is null.
  [[nodiscard]] std::string_view bytes(int row, int column) const;

 private:
  struct Clear {
    void operator()(PGresult* result) const { libpq().PQclear(result); }
  };
  std::unique_ptr<PGresult, Clear> result_;
};

/// Returns texts as a value of the type text[].
[[nodiscard]] std::string text_array(const std::vector<std::string>& texts);

/// A statement with the values of its parameters $1, $2 …
class PgStatement {
 public:
  PgStatement(const char* sql) : sql_(sql) {}  // NOLINT(google-explicit-constructor): as it is read
  PgStatement&& text(std::string_view value) && { return std::move(*this).add(std::string(value), 0); }
  PgStatement&& blob(std::string_view value) && { return std::move(*this).add(std::string(value), 1); }
  PgStatement&& number(std::int64_t value) && { return std::move(*this).add(std::to_string(value), 0); }
  PgStatement&& real(double value) &&;

 private:
  friend class Postgres;
  PgStatement&& add(std::string value, int format) && {
    values_.push_back(std::move(value));
    formats_.push_back(format);
    return std::move(*this);
  }

  const char* sql_;
  std::vector<std::string> values_;
  std::vector<int> formats_;
};

/// Used by one thread at a time. Errors: unavailable, of field "state", with the server's address as value.
/// After a time without traffic the connection is closed; whether what it had begun is undone or was done is
/// then unknown.
class Postgres {
 public:
  static constexpr std::chrono::seconds kPatience{5};

  /// `uri` is libpq's, without a password.
  [[nodiscard]] static Expected<Postgres> open(const std::string& uri);

  /// Runs the statements in order, in one round trip; in one transaction of their own if none is open. The
  /// first failure ends it.
  [[nodiscard]] Expected<std::vector<PgRows>> run(std::span<const PgStatement> statements);
  [[nodiscard]] Expected<PgRows> run(const PgStatement& statement);
  /// SQLSTATE of the last failure; empty if the connection failed.
  [[nodiscard]] const std::string& state() const { return state_; }
  [[nodiscard]] bool is_open() const { return connection_ != nullptr; }
  void close() { connection_ = nullptr; }

  /// Waits for a notification or until `descriptor` is readable, at most `patience`. Returns whether a
  /// notification has come.
  [[nodiscard]] Expected<bool> wait(int descriptor, std::chrono::milliseconds patience);

 private:
  using Time = std::chrono::steady_clock::time_point;
  [[nodiscard]] Expected<void> wait_for(short events, Time end);
  [[nodiscard]] Expected<PGresult*> next_result(Time::duration patience);
  [[nodiscard]] Error fault(std::string why) const;
  [[nodiscard]] Error lost(std::string why);
  [[nodiscard]] bool take_notifications();

  struct Finish {
    void operator()(PGconn* connection) const { libpq().PQfinish(connection); }
  };
  std::unique_ptr<PGconn, Finish> connection_;
  std::string where_, state_;
};

}  // namespace marble::server
