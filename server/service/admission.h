// Turns a request's message into a validated job.
#pragma once

#include <grpcpp/server_context.h>

#include <memory>
#include <span>

#include "base/origin.h"
#include "jobs/job.h"
#include "marble/v1/service.pb.h"
#include "marble/v1/session.pb.h"
#include "service/sensitivity_limits.h"
#include "service/service_parts.h"

namespace marble::server {

/// Who calls, from where, and the deadline of the call.
struct Caller {
  Identity identity;
  Origin origin;
  Clock::time_point deadline = Clock::time_point::max();
  /// State of a job that was accepted before the server restarted, or by another server.
  struct Earlier {
    std::string id;
    std::chrono::system_clock::time_point accepted;
    std::shared_ptr<JobRecord> record = nullptr;  ///< if the job has one already
  };
  std::optional<Earlier> earlier = {};
};

/// Identifies the caller and records it in the origin. Errors: unauthenticated, permission_denied (the role
/// is missing).
[[nodiscard]] Expected<Caller> caller_of(const ServiceParts& parts,
                                         const grpc::CallbackServerContext& context, Origin& origin,
                                         Role role);

/// Identifies the caller of a method that any role may call. Logs a refusal.
[[nodiscard]] Expected<Identity> identify(const ServiceParts& parts,
                                          const grpc::CallbackServerContext& context, Origin& origin);

/// The checked parts that a request to solve and a session's set-up have in common, and the record of the
/// future job, which no one sees yet. Borrows the message's arrays.
struct CheckedRequest {
  Problem problem;
  Options options;
  Priority priority;
  std::span<const double> initial_z;
  std::optional<Solution> warm_start;
  std::optional<CheckedSensitivity> sensitivity;
  std::shared_ptr<JobRecord> record;
};

/// Error fields are paths from the message's root. Errors: invalid_argument, permission_denied (a priority
/// above the quota's), resource_exhausted (the request asks for too many derivatives of the solution).
[[nodiscard]] Expected<CheckedRequest> check_request(const ServiceParts& parts, const Caller& caller,
                                                     const Quota& quota, JobKind kind,
                                                     const v1::SessionSetup& message);

/// The checked parts that all elements of an array share.
struct CheckedArray {
  Options options;
  Priority priority;
  std::optional<PartSizes> base;  ///< sizes of the base problem, if there is one
  std::shared_ptr<JobRecord> record;
};
/// Error fields are paths from the message's root. Errors: as above.
[[nodiscard]] Expected<CheckedArray> check_request(const ServiceParts& parts, const Caller& caller,
                                                   const Quota& quota, const v1::ArraySetup& message);

/// Checks how often progress is to be reported.
[[nodiscard]] Expected<void> check_progress(double interval_s, std::int32_t iterate_every);

/// Checks the whole request, which the job then keeps. Error fields are paths from the request's root. The
/// job has no observer yet.
[[nodiscard]] Expected<std::shared_ptr<Job>> make_job(const ServiceParts& parts, const Caller& caller,
                                                      JobKind kind,
                                                      std::shared_ptr<const v1::SolveRequest> request);

/// Refuses a request, of which only the head is read, if the scheduler would refuse its job anyway: parsing
/// and checking the whole request takes many times as long, which a server with too much to do has not.
/// Reads nothing while a worker is free, or of a call without a deadline. `field`: see read_head(). Records
/// the request's id in the origin. Errors: those of Scheduler::admit().
[[nodiscard]] Expected<void> refuse_early(const ServiceParts& parts, const Caller& caller,
                                          const grpc::ByteBuffer& request, Origin& origin, int field = 0);

/// Counts and logs a request that does not become a job.
void note_refusal(const ServiceParts& parts, const Origin& origin, const Error& error);
/// Does the same, and returns the status for the caller.
[[nodiscard]] grpc::Status refused(const ServiceParts& parts, const Origin& origin, const Error& error);

/// Returns the status of a stream that ends early, with the time to retry if the server is shutting down.
[[nodiscard]] grpc::Status end_of_stream(const ServiceParts& parts, const Error& error);

}  // namespace marble::server
