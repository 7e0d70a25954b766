// Points at which tests kill the server, as a crash or a power failure would: those where a guarantee could
// break.
#pragma once

#include <string_view>

namespace marble::server {

/// Kills this process, as kill -9 does, if the environment requests it: MARBLE_FAULT_POINT=NAME:N, the Nth
/// time that it passes the point of that name. Thread-safe.
///
/// - before_commit: a transaction of the store is complete, but not on disk
/// - after_commit: it is on disk, but no one has been notified
/// - before_answer: a submitted job has its result, but the store has not received it
/// - within_answer: a result is on its way to its client
///
/// With MARBLE_FAULT_POINT=NAME=SUBJECT the server is killed each time it passes the point with this
/// subject; with NAME!SUBJECT an exception is thrown there. The subject is the request id of a submitted
/// job:
///
/// - take: the server takes the job from the store
/// - job: a worker begins the job
void fault_point(std::string_view name, std::string_view subject = {});

}  // namespace marble::server
