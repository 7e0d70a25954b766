// An update of a session in the core's terms, and the maximum size of an update.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include "jobs/job_record.h"
#include "jobs/scheduler.h"
#include "marble/v1/session.pb.h"
#include "marble/warm_solver.h"
#include "service/sensitivity_limits.h"

namespace marble::server {

/// An update that a session of its sizes can apply, including the changes of earlier updates merged into it.
class Update {
 public:
  /// Takes ownership of the message's contents if a session of these sizes can apply it. Error fields are
  /// paths from the request's root. Errors: invalid_argument, resource_exhausted (it asks for more
  /// derivatives than `derivatives` allows).
  [[nodiscard]] static Expected<Update> check(v1::SessionUpdate& message, const PartSizes& sizes,
                                              const Options& in_force,
                                              const SensitivityLimits& derivatives = {});

  [[nodiscard]] std::int64_t sequence() const { return message_.sequence(); }
  /// True for the preparation phase of an update in two phases.
  [[nodiscard]] bool prepares() const { return message_.prepare(); }
  /// The options that apply to it.
  [[nodiscard]] const Options& options() const { return options_; }
  [[nodiscard]] Clock::time_point arrival() const { return arrival_; }
  /// The time from which its result is useless; never, unless the update sets one.
  [[nodiscard]] Clock::time_point deadline() const;
  /// Memory that it takes while it waits or runs, without derivatives.
  [[nodiscard]] std::int64_t bytes() const;
  /// The derivatives that it asks for; views this object.
  [[nodiscard]] std::optional<SensitivityRequest> sensitivity() const;
  /// Memory of that request and its result; 0 if there is none.
  [[nodiscard]] std::int64_t sensitivity_bytes() const { return sensitivity_bytes_; }
  /// Gives it memory for derivatives, for the lifetime of this object; without memory the request is
  /// dropped, and the result reports that.
  void give_sensitivity_room(std::unique_ptr<Scheduler::Held> room);
  void forget_sensitivity();
  /// True if there was no memory for the requested derivatives.
  [[nodiscard]] bool lacks_sensitivity_room() const { return lacks_sensitivity_room_; }

  /// Adds the changes of `older` that this update does not make itself. Together they are no larger than
  /// most_update_bytes().
  void take_along(Update older);

  /// For the solver; views this object. With a deadline, its solve ends early enough for the result to
  /// arrive in time.
  [[nodiscard]] CheckedUpdate checked() const;

  bool taken = false;  ///< set by the solver

 private:
  Update(v1::SessionUpdate message, const PartSizes& sizes, const Options& options)
      : message_(std::move(message)), sizes_(sizes), options_(options) {}
  [[nodiscard]] Restart restart() const;

  v1::SessionUpdate message_;  // without its shift
  PartSizes sizes_;
  Options options_;
  Shift shift_;
  Clock::time_point arrival_ = Clock::now();
  std::int64_t sensitivity_bytes_ = 0;
  std::shared_ptr<Scheduler::Held> sensitivity_room_;
  bool lacks_sensitivity_room_ = false;
};

/// Bytes of every number of a session of these sizes, and of a block of a shift for every entry.
[[nodiscard]] std::int64_t most_update_bytes(const PartSizes& sizes);

/// Parses a message to a session that is set up. A message larger than any update of the session is refused
/// before that, allowing this many bytes for the request for derivatives; the error's field is its path.
[[nodiscard]] Expected<void> parse_update(grpc::ByteBuffer& bytes, const PartSizes& sizes,
                                          v1::SessionRequest* request, std::int64_t sensitivity_bytes = 0);

}  // namespace marble::server
