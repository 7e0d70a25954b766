// What came of many requests: counts and latencies, by entry of the scenario.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "measure/histogram.h"
#include "measure/work.h"
#include "mutex.h"

namespace marble::load {

/// Times in nanoseconds.
struct EntryTally {
  Histogram latency;       ///< of answers: from the intended time of sending to the answer
  Histogram service;       ///< the same from the actual time of sending
  Histogram queue, solve;  ///< as the server tells them: waiting for a worker; the solve without its set-up
  Histogram run;           ///< the server's own total less the wait: what a worker was busy for
  Histogram outside;       ///< service less the server's own total: the way there and back, parsing, threads
  Histogram refusal;       ///< of errors: from the actual time of sending
  std::uint64_t answers = 0;
  std::map<std::string, std::uint64_t> statuses;  ///< of answers: "solved", "time_limit"
  std::map<std::string, std::uint64_t> errors;    ///< by code
  std::uint64_t with_retry_info = 0;              ///< of the errors
  std::uint64_t progress_rows = 0, progress_skipped = 0;

  void merge(const EntryTally& other);
  void clear();
  [[nodiscard]] std::uint64_t error_count() const;
};

struct Tally {
  explicit Tally(std::size_t entry_count = 0) : entries(entry_count) {}

  std::vector<EntryTally> entries;
  Histogram lag;  ///< of all: from the intended to the actual time of sending
  /// Of all requests, measured or not, that ended since the last clear().
  std::uint64_t ended_answers = 0, ended_errors = 0;
  std::map<std::string, std::string> messages;  ///< of each error code, the first that came

  void merge(const Tally& other);
  void clear();
  [[nodiscard]] EntryTally sum() const;
};

/// Counts from many threads, which hardly ever meet.
class Recorder {
 public:
  explicit Recorder(std::size_t entries);
  void add(const Work& work, const Reply& reply, Clock::time_point now);
  /// What came since the last time.
  [[nodiscard]] Tally take();

 private:
  struct alignas(64) Shard {
    Mutex mutex;
    Tally tally ABSL_GUARDED_BY(mutex);
  };
  const std::size_t entries_;
  std::array<Shard, 8> shards_;
};

}  // namespace marble::load
