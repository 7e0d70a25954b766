// Interface of submitted jobs, kept in memory, in a file of this server, or in a store that several servers
// share.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/identity.h"
#include "marble/v1/service.pb.h"
#include "store/group_writer.h"

namespace marble::server {

class ArrayDraft;
struct Caller;
struct FoundArray;

/// What a call's response waits for, if it is not sent at once: calls back with the outcome. The response
/// may be filled until then.
using OnFinished = std::function<void(CompletionCallback)>;

/// The request and the result of a job, as bytes of marble.v1.SolveRequest and SolveResponse.
struct AskedAndAnswered {
  std::string request;
  std::string answer;  ///< empty if there is none, or not yet
};

/// Thread-safe.
class Submissions {
 public:
  virtual ~Submissions() = default;

  /// Accepts the job; if there is a store, the response waits until the job is in it. A request with an id
  /// that the client has used before, for a job that is still kept, returns that job. Errors: those of
  /// admission; unavailable (the store cannot write).
  [[nodiscard]] virtual Expected<OnFinished> submit(const Caller& caller,
                                                    std::shared_ptr<v1::SolveRequest> request,
                                                    v1::SubmitResponse* response) = 0;
  /// Requests the end of any job; that of a submitted job survives a restart. Errors: not_found,
  /// permission_denied, unavailable.
  [[nodiscard]] virtual Expected<OnFinished> cancel(const Identity& caller, const std::string& id,
                                                    v1::CancelJobResponse* response) = 0;
  /// Deletes a submitted job and its result. Errors: as of cancel().
  [[nodiscard]] virtual Expected<OnFinished> remove(const Identity& caller, const std::string& id) = 0;
  /// Calls back when this server's state of the job, or of all jobs if the id is empty, equals the store's;
  /// if that takes too long, with the current state. Errors: unavailable (nothing is known of the job).
  virtual void look(const std::string& id, CompletionCallback then) = 0;

  /// Returns both, for a submitted job that has `finished`, or for one that has not, then without a result.
  /// Errors: not_found (the request is no longer kept, or the job was deleted), unavailable.
  virtual void fetch_pair(const std::string& id, bool finished,
                          std::function<void(Expected<AskedAndAnswered>)> then) = 0;

  /// Begins to receive an array. Error fields are paths from the set-up's root. Errors: those of admission;
  /// unavailable (draining, or the store cannot write).
  [[nodiscard]] virtual Expected<std::shared_ptr<ArrayDraft>> begin_array(const Caller& caller,
                                                                          v1::ArraySetup setup) = 0;
  /// Calls back with the array, for one reader. Errors: not_found, unavailable.
  virtual void find_array(const std::string& id, std::function<void(Expected<FoundArray>)> then) = 0;
  /// True if the job is known to be an array.
  [[nodiscard]] virtual bool is_array(const std::string& id) const = 0;

  /// The error if nothing can be written.
  [[nodiscard]] virtual Expected<void> health() const = 0;
  /// Empty if there is no store.
  [[nodiscard]] virtual std::optional<StoreUsage> usage() const = 0;
  /// The store writes the pending changes, and nothing from then on.
  virtual void close() = 0;
  /// Returns the error of a submission while nothing can be written.
  [[nodiscard]] static Error not_kept(const Error& why) {
    return failure(ErrorCode::unavailable, "the server cannot keep a job now: " + why.bound);
  }
  /// Returns the error if a job is known, but its request is not.
  [[nodiscard]] static Error no_request(const std::string& id) {
    return failure(
        ErrorCode::failed_precondition, "job_id", id,
        "is a job whose request is not kept any more: the oldest are let go where there is no room");
  }
  /// True if the store has everything, and everyone was notified.
  [[nodiscard]] virtual bool is_settled() const = 0;
};

}  // namespace marble::server
