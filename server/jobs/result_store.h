// Answers of submitted jobs, kept for a bounded time and size until their clients come for them, and their
// requests for as long as there is room beside.
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
  std::int64_t bytes = 0;  ///< of all answers and requests; the oldest go first, requests before any answer
};

/// Thread-safe. Callbacks are called without a lock.
class ResultStore {
 public:
  /// A serialized answer, or why there is none and when to try again. Whoever is given it shares its bytes.
  struct Result {
    Expected<grpc::ByteBuffer> answer;
    double retry_delay_s = 0.0;
  };
  using Shared = std::shared_ptr<const Result>;
  using Callback = std::function<void(Shared)>;

  /// Told of each that is let go, whyever.
  using Forgotten = std::function<void(const std::string& id)>;

  /// `request_forgotten` is told of each request that is let go while its answer stays.
  explicit ResultStore(const ResultLimits& limits, Forgotten forgotten = {}, Forgotten request_forgotten = {})
      : limits_(limits), forgotten_(std::move(forgotten)), request_forgotten_(std::move(request_forgotten)) {}

  /// Another who is told of each that is let go, as the first is.
  void tell_forgotten(Forgotten also) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Gets an answer that another keeps: to be given to deliver().
  using Fetch = std::function<void(const std::string& id)>;
  /// Before anybody waits.
  void set_fetch(Fetch fetch) { fetch_ = std::move(fetch); }
  /// Another keeps its answer: whoever waits for it, now or later, makes that it is fetched.
  void kept_elsewhere(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// To those who wait; nothing is kept.
  void deliver(const std::string& id, Result result) ABSL_LOCKS_EXCLUDED(mutex_);

  /// What a client calls a request, so that it may send it again; the digest tells whether it is the same.
  struct RequestName {
    std::string request_id;  ///< empty: it has none
    std::string digest;
  };
  /// A job of this client will have an answer. Nothing is expected, and the id is that of the earlier job, if
  /// the client has had one by this name that is not let go yet. Errors: invalid_argument (that was for
  /// another request).
  [[nodiscard]] Expected<std::string> expect(const std::string& id, const std::string& client,
                                             const RequestName& name = {}) ABSL_LOCKS_EXCLUDED(mutex_);
  /// The job that the client has by this name; empty if there is none.
  [[nodiscard]] std::string named(const std::string& client, const std::string& request_id) const
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Answers of an array that is expected take so many bytes more, for which others make room. False, if it
  /// is not expected any more, or arrays without their last answer would take more than half of all together:
  /// what cannot be let go must leave room for what comes.
  [[nodiscard]] bool grow(const std::string& id, std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  /// What a job that is expected was asked.
  struct Request {
    std::shared_ptr<const v1::SolveRequest> message;  ///< null where a store has it
    std::int64_t bytes = 0;
  };
  /// Keeps it for as long as the answer, and there is room.
  void keep_request(const std::string& id, Request request) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Nothing if it is not kept, or not any more.
  [[nodiscard]] std::optional<Request> request(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);

  /// Here it is. Dropped if nobody expects it any more; true if it is kept. One that alone is larger than
  /// all that may be kept is replaced by an error.
  /// `besides` counts as well: answers of an array that ended before this server was started.
  bool put(const std::string& id, Result result, Clock::time_point now, std::int64_t besides = 0)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Whose it is; empty if it is not known, or not any more.
  [[nodiscard]] std::string owner(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);
  /// The answer, null while there is none.
  [[nodiscard]] Shared get(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Calls back when the answer comes, at once if it is there; with null if it is let go first. `waiter`
  /// names the callback for stop_waiting().
  void wait(const std::string& id, const void* waiter, Callback callback) ABSL_LOCKS_EXCLUDED(mutex_);
  void stop_waiting(const std::string& id, const void* waiter) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Lets it go. True if it was there.
  bool forget(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Lets go of what is too old.
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
    std::list<Age>::iterator age;  // of one that has a result
    std::optional<Request> request;
    std::list<std::string>::iterator request_age;  // of one that has both
    std::vector<std::pair<const void*, Callback>> waiters;
    bool elsewhere = false;
  };
  bool erase(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void drop_request(Entry& entry) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void drop_oldest(std::vector<std::string>& erased) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] std::vector<std::string> make_room_for_answers() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static void tell(const Forgotten& forgotten, const std::vector<std::string>& ids);
  void tell_all(const std::vector<std::string>& forgotten) const ABSL_LOCKS_EXCLUDED(mutex_);

  const ResultLimits limits_;
  const Forgotten forgotten_, request_forgotten_;
  Fetch fetch_;
  mutable Mutex mutex_;
  Forgotten also_forgotten_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, Entry> entries_ ABSL_GUARDED_BY(mutex_);
  std::map<std::pair<std::string, std::string>, std::string> ids_
      ABSL_GUARDED_BY(mutex_);                   // by client and request id
  std::list<Age> ages_ ABSL_GUARDED_BY(mutex_);  // of those that have a result, oldest first
  std::int64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t growing_ ABSL_GUARDED_BY(mutex_) = 0;         // of them, those of arrays without a result
  std::list<std::string> requests_ ABSL_GUARDED_BY(mutex_);  // ids of those that have both, oldest first
  std::int64_t request_bytes_ ABSL_GUARDED_BY(mutex_) = 0;   // of these
};

}  // namespace marble::server
