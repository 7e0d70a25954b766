// Moments at which tests have the server killed, as a crash or a power cut would: those where a promise could
// break.
#pragma once

#include <string_view>

namespace marble::server {

/// Kills this process, as kill -9 does, if the environment says so: MARBLE_FAULT_POINT=NAME:N, the Nth time
/// that it comes by the point of that name. Thread-safe.
///
/// - before_commit: a transaction of the store is whole, and not on disk
/// - after_commit: it is on disk, and nobody was told
/// - before_answer: a submitted job has its answer, which the store has not been given
/// - within_answer: an answer is on its way to its client
///
/// With MARBLE_FAULT_POINT=NAME=SUBJECT the server is killed each time it passes the point with this subject;
/// with NAME!SUBJECT an exception is thrown there. The subject is the request id of a submitted job:
///
/// - take: the server takes the job from the store
/// - job: a worker begins the job
void fault_point(std::string_view name, std::string_view subject = {});

}  // namespace marble::server
