// Results of submitted jobs, kept for a bounded time and size until their clients fetch them, and their
// requests while there is memory besides.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "jobs/job_record.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

struct ResultLimits {
  Clock::duration keep = std::chrono::hours(1);
  std::int64_t bytes = 0;  ///< results and requests; drops the oldest first, requests before results
};

/// Thread-safe. Callbacks are called without a lock.
class ResultStore {
 public:
  /// A serialized result, or an error with the time to retry. All holders share its bytes.
  struct Result {
    Expected<grpc::ByteBuffer> answer;
    double retry_delay_s = 0.0;
  };
  using Shared = std::shared_ptr<const Result>;
  using Callback = std::function<void(Shared)>;

  /// Called for each result that is dropped, for any reason.
  using Forgotten = std::function<void(const std::string& id)>;

  /// `request_forgotten` is called for each request that is dropped while its result stays.
  explicit ResultStore(const ResultLimits& limits, Forgotten forgotten = {}, Forgotten request_forgotten = {})
      : limits_(limits), forgotten_(std::move(forgotten)), request_forgotten_(std::move(request_forgotten)) {}

  /// Adds a callback for each result that is dropped, like the first.
  void report_forgotten(Forgotten also) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Fetches a result that another server keeps, to be passed to deliver().
  using Fetch = std::function<void(const std::string& id)>;
  /// Must be called before any wait.
  void set_fetch(Fetch fetch) { fetch_ = std::move(fetch); }
  /// Another server keeps the result: each current or later wait for it starts a fetch.
  void kept_elsewhere(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Gives the result to those who wait; keeps nothing.
  void deliver(const std::string& id, Result result) ABSL_LOCKS_EXCLUDED(mutex_);

  /// The client's name of a request, so that it can send it again; the digest shows whether it is the same.
  struct RequestName {
    std::string request_id;  ///< empty: it has none
    std::string digest;
  };
  /// Announces that a job of this client will have a result. Announces nothing and returns the id of the
  /// earlier job if the client has one by this name that is not dropped yet. Errors: invalid_argument (the
  /// name was used for another request).
  [[nodiscard]] Expected<std::string> expect(const std::string& id, const std::string& client,
                                             const RequestName& name = {}) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the client's job by this name; empty if there is none.
  [[nodiscard]] std::string named(const std::string& client, const std::string& request_id) const
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Results of an expected array take this many more bytes; others are dropped for them. False if the array
  /// is no longer expected, or if arrays without their last result would take more than half of the total:
  /// what cannot be dropped must leave memory for new results.
  [[nodiscard]] bool grow(const std::string& id, std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  /// An expected array takes no memory any more: another server continues it.
  void stop_growing(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// The request of an expected job.
  struct Request {
    std::shared_ptr<const v1::SolveRequest> message;  ///< null if a store has it
    std::int64_t bytes = 0;
  };
  /// Keeps it as long as the result, and while there is memory.
  void keep_request(const std::string& id, Request request) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Empty if it is not kept, or not any more.
  [[nodiscard]] std::optional<Request> request(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);

  /// Stores a result. It is dropped if it is no longer expected; returns true if it is kept. A result that
  /// alone exceeds the total limit is replaced by an error. `besides` counts as well: results of an array
  /// that ended before this server started.
  bool put(const std::string& id, Result result, Clock::time_point now, std::int64_t besides = 0)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns its client; empty if it is unknown, or dropped.
  [[nodiscard]] std::string owner(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the result, null while there is none.
  [[nodiscard]] Shared get(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Calls back when the result exists, at once if it does; with null if it is dropped first. `waiter`
  /// identifies the callback for stop_waiting().
  void wait(const std::string& id, const void* waiter, Callback callback) ABSL_LOCKS_EXCLUDED(mutex_);
  void stop_waiting(const std::string& id, const void* waiter) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Drops it. Returns whether it existed.
  bool forget(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Drops results that are too old.
  void expire(Clock::time_point now) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::int64_t bytes() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Age {
    std::string id;
    Clock::time_point end;
  };
  struct Entry {
    std::string client;
    RequestName name;
    Shared result;
    std::int64_t bytes = 0;
    std::list<Age>::iterator age;  // set if there is a result
    std::optional<Request> request;
    std::list<std::string>::iterator request_age;  // set if there are both
    std::vector<std::pair<const void*, Callback>> waiters;
    bool elsewhere = false;
  };
  void release(Entry& entry) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool erase(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void drop_request(Entry& entry) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void drop_oldest(std::vector<std::string>& erased) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::vector<std::string> make_room_for_answers() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static void report(const Forgotten& forgotten, const std::vector<std::string>& ids);
  void report_all(const std::vector<std::string>& forgotten) const ABSL_LOCKS_EXCLUDED(mutex_);

  const ResultLimits limits_;
  const Forgotten forgotten_, request_forgotten_;
  Fetch fetch_;
  mutable Mutex mutex_;
  Forgotten also_forgotten_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, Entry> entries_ ABSL_GUARDED_BY(mutex_);
  std::map<std::pair<std::string, std::string>, std::string> ids_
      ABSL_GUARDED_BY(mutex_);                   // keys: client and request id
  std::list<Age> ages_ ABSL_GUARDED_BY(mutex_);  // of those that have a result, oldest first
  std::int64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t growing_ ABSL_GUARDED_BY(mutex_) = 0;         // part of bytes_: arrays without a result
  std::list<std::string> requests_ ABSL_GUARDED_BY(mutex_);  // ids of those that have both, oldest first
  std::int64_t request_bytes_ ABSL_GUARDED_BY(mutex_) = 0;   // bytes of these requests
};

}  // namespace marble::server
