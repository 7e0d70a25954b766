// Readers of arrays in a shared store, on any of its servers.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/postgres.h"
#include "mutex.h"
#include "store/array_source.h"

namespace marble::server {

class FleetArrayResults;

/// What the readers of this server wait for. Requests come from any thread; the mirror's thread serves them.
class FleetReaders {
 public:
  using Find = std::function<void(Expected<FoundArray>)>;

  /// `ring` wakes the mirror's thread.
  explicit FleetReaders(std::function<void()> ring) : ring_(std::move(ring)) {}

  /// Calls back with the array, for one reader. Errors: not_found, unavailable.
  void find(const std::string& id, Find then) ABSL_LOCKS_EXCLUDED(mutex_);
  /// The reader waits for results.
  void ask(std::weak_ptr<FleetArrayResults> reader) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Serves new requests, and those that wait if the store has changed since. Errors: those of the store;
  /// then nothing is lost.
  [[nodiscard]] Expected<void> serve(Postgres& database, bool changed) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Nothing can be found now.
  void refuse(const Error& why) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Limits the time until the next serve().
  [[nodiscard]] std::chrono::milliseconds patience(std::chrono::milliseconds most) const;

 private:
  using Readers = std::vector<std::weak_ptr<FleetArrayResults>>;
  struct Lookup {
    std::string id;
    Find then;
  };
  [[nodiscard]] Expected<void> serve_finds(Postgres& database) ABSL_LOCKS_EXCLUDED(mutex_);

  const std::function<void()> ring_;
  Mutex mutex_;
  std::vector<Lookup> finds_ ABSL_GUARDED_BY(mutex_);
  Readers asked_ ABSL_GUARDED_BY(mutex_);
  Readers waiting_;  // used by the mirror's thread, like all that follow
  bool changed_ = false;
  std::chrono::steady_clock::time_point served_ = {};
};

/// The results of one array for one reader. Thread-safe.
class FleetArrayResults final : public ArraySource, public std::enable_shared_from_this<FleetArrayResults> {
 public:
  FleetArrayResults(FleetReaders& readers, std::string id) : readers_(readers), id_(std::move(id)) {}

  [[nodiscard]] Expected<News> news_after(std::int64_t sequence, std::int64_t most_bytes) override
      ABSL_LOCKS_EXCLUDED(mutex_);
  void listen(const std::weak_ptr<ArrayListener>& listener) override ABSL_LOCKS_EXCLUDED(mutex_);

  /// Reads what it waits for. Returns whether it still waits.
  [[nodiscard]] Expected<bool> read(Postgres& database) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  [[nodiscard]] Expected<News> read_news(Postgres& database, std::int64_t after, std::int64_t most_bytes,
                                         bool& gone) const;

  FleetReaders& readers_;
  const std::string id_;
  Mutex mutex_;
  bool waits_ ABSL_GUARDED_BY(mutex_) = false;
  std::int64_t after_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t most_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::optional<News> news_ ABSL_GUARDED_BY(mutex_);  // the results after `after_`
  bool is_gone_ ABSL_GUARDED_BY(mutex_) = false;
  std::weak_ptr<ArrayListener> listener_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
