// What an update of a session says, in the core's terms, and how large it may be.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include "jobs/job_record.h"
#include "marble/v1/session.pb.h"
#include "marble/warm_solver.h"
#include "messages/sensitivity_limits.h"
#include "queue/scheduler.h"

namespace marble::server {

/// An update on its way: one that a session of its sizes can take, whatever it has taken along.
class Update {
 public:
  /// Takes the message over if a session of these sizes can take it. Error fields are paths from the
  /// request's root. Errors: invalid_argument, resource_exhausted (more is asked of derivatives than
  /// `derivatives` allows).
  [[nodiscard]] static Expected<Update> check(v1::SessionUpdate& message, const PartSizes& sizes,
                                              const Options& in_force,
                                              const SensitivityLimits& derivatives = {});

  [[nodiscard]] std::int64_t sequence() const { return message_.sequence(); }
  /// Whether it is the first of two parts.
  [[nodiscard]] bool prepares() const { return message_.prepare(); }
  /// Those in force for it.
  [[nodiscard]] const Options& options() const { return options_; }
  [[nodiscard]] Clock::time_point arrival() const { return arrival_; }
  /// When its answer is of no use any more; never, unless it says so.
  [[nodiscard]] Clock::time_point deadline() const;
  /// What it takes while it waits or runs, but for derivatives.
  [[nodiscard]] std::int64_t bytes() const;
  /// What is asked of its answer's derivatives; views this.
  [[nodiscard]] std::optional<SensitivityRequest> sensitivity() const;
  /// Of that with the answer to it; 0 where nothing is.
  [[nodiscard]] std::int64_t sensitivity_bytes() const { return sensitivity_bytes_; }
  /// The room for it, as long as this lives; without it nothing is asked any more, and the answer says so.
  void give_sensitivity_room(std::unique_ptr<Scheduler::Held> room);
  void forget_sensitivity();
  /// There was no room for the derivatives that were asked for.
  [[nodiscard]] bool lacks_sensitivity_room() const { return lacks_sensitivity_room_; }

  /// What `older` would have changed and it does not change itself. Together they are no larger than
  /// most_update_bytes().
  void take_along(Update older);

  /// For the solver; views this. With a deadline its solve ends early enough for the answer to arrive by
  /// then.
  [[nodiscard]] CheckedUpdate checked() const;

  bool taken = false;  ///< by the solver

 private:
  Update(v1::SessionUpdate message, const PartSizes& sizes, const Options& options)
      : message_(std::move(message)), sizes_(sizes), options_(options) {}
  [[nodiscard]] Restart restart() const;

  v1::SessionUpdate message_;  // but for its shift
  PartSizes sizes_;
  Options options_;
  Shift shift_;
  Clock::time_point arrival_ = Clock::now();
  std::int64_t sensitivity_bytes_ = 0;
  std::shared_ptr<Scheduler::Held> sensitivity_room_;
  bool lacks_sensitivity_room_ = false;
};

/// Every number of a session of these sizes, and a block of a shift for every entry.
[[nodiscard]] std::int64_t most_update_bytes(const PartSizes& sizes);

/// Parses a message to a session that is set up. One that is larger than any update of it can be is refused
/// before, with so many bytes for what is asked of derivatives; the error's field says where it is.
[[nodiscard]] Expected<void> parse_update(grpc::ByteBuffer& bytes, const PartSizes& sizes,
                                          v1::SessionRequest* request, std::int64_t sensitivity_bytes = 0);

}  // namespace marble::server
