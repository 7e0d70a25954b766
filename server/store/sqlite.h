// SQLite's C interface as values that close themselves, with errors in SQLite's own words.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "marble/error.h"

namespace marble::server {

class Statement;

/// One connection, for one thread at a time. Errors: unavailable, of field state_dir, with the file as
/// value; resource_exhausted for a text or blob that is larger than SQLite's limit, 10^9 bytes.
class Database {
 public:
  /// Creates the file if there is none.
  [[nodiscard]] static Expected<Database> open(const std::string& file);

  /// Runs statements without results.
  [[nodiscard]] Expected<void> run(const std::string& sql);
  [[nodiscard]] Expected<Statement> prepare(std::string_view sql);
  /// Returns the only value of the only row.
  [[nodiscard]] Expected<std::string> ask(std::string_view sql);

 private:
  struct Close {
    void operator()(sqlite3* connection) const { sqlite3_close_v2(connection); }
  };
  std::unique_ptr<sqlite3, Close> connection_;
};

/// Parameters are numbered from 1, columns from 0. Bound texts and blobs must live until the next step() or
/// run().
class Statement {
 public:
  Statement& bind(int at, std::int64_t value);
  Statement& bind(int at, double value);
  Statement& bind(int at, std::string_view text);
  Statement& bind_blob(int at, std::string_view bytes);
  /// The error, if any, of binding the parameters.
  [[nodiscard]] Expected<void> bound() const;

  /// Returns whether there is another row.
  [[nodiscard]] Expected<bool> step();
  /// Runs to the end, and resets the statement for another run.
  [[nodiscard]] Expected<void> run();

  [[nodiscard]] std::int64_t integer(int column) const {
    return sqlite3_column_int64(statement_.get(), column);
  }
  [[nodiscard]] double real(int column) const { return sqlite3_column_double(statement_.get(), column); }
  [[nodiscard]] bool is_null(int column) const {
    return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
  }
  /// Returns a text or a blob.
  [[nodiscard]] std::string bytes(int column) const;

 private:
  friend Database;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  explicit Statement(sqlite3_stmt* statement) : statement_(statement) {}

  void note(int code) {
    if (code != SQLITE_OK) bound_ = code;
  }

  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  int bound_ = SQLITE_OK;
};

}  // namespace marble::server
