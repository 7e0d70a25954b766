// Submitted jobs, whatever keeps them: memory, a file of this server, or a store that several share.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/identity.h"
#include "marble/v1/service.pb.h"
#include "store/group_writer.h"

namespace marble::server {

class Arrays;
struct Caller;

/// What a call's answer waits for, where it is not to go out at once: told how that ended. The response may
/// be filled until then.
using Afterwards = std::function<void(Settled)>;

/// What a job was asked and answered, as bytes of marble.v1.SolveRequest and SolveResponse.
struct AskedAndAnswered {
  std::string request;
  std::string answer;  ///< empty if there is none, or not yet
};

/// Thread-safe.
class Submissions {
 public:
  virtual ~Submissions() = default;

  /// Takes the job in; where there is a store, the answer waits until it is there. A request by an id that
  /// the client has used before, of a job that is still kept, is that job. Errors: what admission refuses;
  /// unavailable (the store cannot write).
  [[nodiscard]] virtual Expected<Afterwards> submit(const Caller& caller,
                                                    std::shared_ptr<v1::SolveRequest> request,
                                                    v1::SubmitResponse* response) = 0;
  /// Asks for the end of any job; that of a submitted one is not forgotten by a restart. Errors: not_found,
  /// permission_denied, unavailable.
  [[nodiscard]] virtual Expected<Afterwards> cancel(const Identity& caller, const std::string& id,
                                                    v1::CancelJobResponse* response) = 0;
  /// Lets a submitted job and its answer go. Errors: as of cancel().
  [[nodiscard]] virtual Expected<Afterwards> remove(const Identity& caller, const std::string& id) = 0;
  /// Calls back when what is known here of the job, or of all if there is no id, is what the store knows now;
  /// where that cannot be found out soon, with what is known. Errors: unavailable (nothing is known of it).
  virtual void look(const std::string& id, Settled then) = 0;

  /// Tells both, of a submitted job that has `finished`, or one that has not: then without an answer. Errors:
  /// not_found (the request is not kept any more, or the job was deleted), unavailable.
  virtual void recall(const std::string& id, bool finished,
                      std::function<void(Expected<AskedAndAnswered>)> then) = 0;

  /// Null where there are none.
  [[nodiscard]] virtual Arrays* arrays() { return nullptr; }

  /// Why nothing can be written, if so.
  [[nodiscard]] virtual Expected<void> health() const = 0;
  /// Nothing where there is no store.
  [[nodiscard]] virtual std::optional<StoreUsage> usage() const = 0;
  /// The store writes what it was given, and nothing from then on.
  virtual void close() = 0;
  /// The error of a submission while nothing can be written.
  [[nodiscard]] static Error not_kept(const Error& why) {
    return failure(ErrorCode::unavailable, "the server cannot keep a job now: " + why.bound);
  }
  /// The error where a job is known, and its request is not.
  [[nodiscard]] static Error no_request(const std::string& id) {
    return failure(
        ErrorCode::failed_precondition, "job_id", id,
        "is a job whose request is not kept any more: the oldest are let go where there is no room");
  }
  /// Whether the store has all that it was given, and everybody has heard of it.
  [[nodiscard]] virtual bool is_settled() const = 0;
};

}  // namespace marble::server
