// From a set-up's message to what a session is made from.
#pragma once

#include <memory>
#include <span>

#include "admission.h"
#include "marble/v1/session.pb.h"

namespace marble::server {

/// A set-up that was checked; the problem and the initial point borrow the message's arrays.
struct CheckedSetup {
  std::shared_ptr<const v1::SessionSetup> message;
  Problem problem;
  Options options;
  Priority priority = Priority::realtime;
  std::span<const double> initial_z = {};
};

/// Takes the message over. Error fields are paths from the request's root. Errors: invalid_argument,
/// permission_denied (the priority).
[[nodiscard]] Expected<CheckedSetup> check_setup(v1::SessionSetup& setup, const Quota& quota,
                                                 const Options& defaults);

/// What is told of the session: its record, which nobody sees yet.
[[nodiscard]] std::shared_ptr<JobRecord> make_record(const JobBoard& board, const Caller& caller,
                                                     const CheckedSetup& setup);

}  // namespace marble::server
