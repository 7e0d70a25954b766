// What an update of a session says, in the core's terms, and how large it may be.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include "job_record.h"
#include "marble/restart.h"
#include "marble/v1/session.pb.h"

namespace marble::server {

/// An update on its way; the options are those in force for it.
struct Update {
  v1::SessionUpdate message;  ///< but for its shift
  Shift shift;
  Options options;
  Clock::time_point arrival = Clock::now();
  bool taken = false;  ///< by the solver
};

/// Every number of a session of these sizes, and a block of a shift for every entry.
[[nodiscard]] std::int64_t most_update_bytes(const PartSizes& sizes);

/// Parses a message to a session that is set up. One that is larger than any update of it can be is refused
/// before; the error's field says where it is.
[[nodiscard]] Expected<void> parse_update(grpc::ByteBuffer& bytes, const PartSizes& sizes,
                                          v1::SessionRequest* request);

/// Takes the message over if a session of these sizes can take it. Its options are not looked at. Error
/// fields are paths from the request's root.
[[nodiscard]] Expected<Update> make_update(v1::SessionUpdate& message, const PartSizes& sizes);

/// `newer` takes along what `older` would have changed and it does not change itself. Together they are no
/// larger than most_update_bytes().
void take_along(Update older, Update& newer, const PartSizes& sizes);

/// The initial point views the update, which must outlive it.
[[nodiscard]] Restart restart_of(const Update& update);

/// What it takes while it waits or runs.
[[nodiscard]] std::int64_t bytes_of(const Update& update);

}  // namespace marble::server
