// Writes the log's lines to a reader that may stall: no thread that logs waits for it.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <thread>

namespace marble::server {

/// Writes on a thread of its own; lines that do not fit into the queue meanwhile are dropped and counted.
/// Thread-safe.
class LogWriter {
 public:
  /// Writes to `fd`, which the caller still owns, and keeps at most `most_bytes` that are not written yet.
  LogWriter(int fd, std::int64_t most_bytes);
  /// Returns when everything is written, or soon after if the reader stalls.
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  struct Backlog {
    bool stalls = false;          ///< something is not written yet, or the last write failed
    std::int64_t unreported = 0;  ///< dropped lines that no line has reported yet
  };
  [[nodiscard]] Backlog backlog() const;
  /// Number of lines dropped since the start.
  [[nodiscard]] std::int64_t dropped() const;

  /// Takes the line, which ends with a newline and reports `reported` of the unreported ones, or drops it.
  void put(std::string_view line, std::int64_t reported);

 private:
  struct Queue;
  const std::shared_ptr<Queue> queue_;  // shared with the thread, which outlives this if the reader stalls
  std::thread thread_;
};

}  // namespace marble::server
