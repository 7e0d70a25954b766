// Holds the outcomes of many requests: counts and latencies, by entry of the scenario.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "histogram.h"
#include "mutex.h"
#include "work.h"

namespace marble::load {

/// Times in nanoseconds.
struct EntryTally {
  Histogram latency;       ///< of results: from the intended send time to the result
  Histogram service;       ///< the same from the actual send time
  Histogram queue, solve;  ///< as the server reports: waiting for a worker; the solve without its set-up
  Histogram run;           ///< the server's own total minus the wait: a worker's busy time
  Histogram outside;       ///< service minus the server's own total: transport, parsing, threads
  Histogram refusal;       ///< of errors: from the actual send time
  std::uint64_t answers = 0;
  std::map<std::string, std::uint64_t> statuses;  ///< of results: "solved", "time_limit"
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
  Histogram lag;  ///< of all: from the intended to the actual send time
  /// Of all requests, measured or not, that ended since the last clear().
  std::uint64_t ended_answers = 0, ended_errors = 0;
  std::map<std::string, std::string> messages;  ///< the first message of each error code

  void merge(const Tally& other);
  void clear();
  [[nodiscard]] EntryTally sum() const;
};

/// Counts from many threads, with little contention.
class Recorder {
 public:
  explicit Recorder(std::size_t entries);
  void add(const Work& work, const Reply& reply, Clock::time_point now);
  /// Returns the counts since the last call.
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
