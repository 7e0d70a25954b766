// The log's lines on their way to a reader that may stall: whoever logs never waits for it.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <thread>

namespace marble::server {

/// A thread of its own writes; lines that do not fit the queue meanwhile are dropped and counted.
/// Thread-safe.
class LogWriter {
 public:
  /// Writes to `fd`, which stays the caller's, and keeps at most `most_bytes` that are not written yet.
  LogWriter(int fd, std::int64_t most_bytes);
  /// Returns when all is written, or soon after if the reader stalls.
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  struct Backlog {
    bool stalls = false;      ///< something is not written yet, or the last write failed
    std::int64_t untold = 0;  ///< lines that were dropped, and no line has told of it
  };
  [[nodiscard]] Backlog backlog() const;
  /// Lines that were dropped since the beginning.
  [[nodiscard]] std::int64_t dropped() const;

  /// Takes the line, which ends with a newline and tells of `told` of the untold ones, or drops it.
  void put(std::string_view line, std::int64_t told);

 private:
  struct Queue;
  const std::shared_ptr<Queue> queue_;  // the thread's too, which a stalled reader may hold beyond our end
  std::thread thread_;
};

}  // namespace marble::server
