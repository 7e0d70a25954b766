// From a request's message to a validated job.
#pragma once

#include <grpcpp/server_context.h>

#include <memory>

#include "job.h"
#include "marble/v1/service.pb.h"
#include "origin.h"
#include "service_parts.h"

namespace marble::server {

/// Who calls, from where, and until when.
struct Caller {
  Identity identity;
  Origin origin;
  Clock::time_point deadline = Clock::time_point::max();
};

/// The origin then knows the client. Errors: unauthenticated, permission_denied without the role.
[[nodiscard]] Expected<Caller> caller_of(const ServiceParts& parts,
                                         const grpc::CallbackServerContext& context, Origin& origin,
                                         Role role);

/// Who calls, where any role will do. A refusal is logged.
[[nodiscard]] Expected<Identity> identify(const ServiceParts& parts,
                                          const grpc::CallbackServerContext& context, Origin& origin);

/// The priority asked for, else `by_default`, but no higher than the quota allows. Errors: permission_denied
/// if more was asked for, invalid_argument if it is none.
[[nodiscard]] Expected<Priority> priority_of(v1::Priority asked, Priority by_default, const Quota& quota);

/// Checks the parts of a request that describe it. Error fields are paths from the request's root.
[[nodiscard]] Expected<void> check_labels(const std::string& request_id, const std::string& problem_name);

/// Checks how often progress is to be told; `path` is what the fields belong to, with its dot, or empty.
[[nodiscard]] Expected<void> check_progress(double interval_s, std::int32_t iterate_every,
                                            const std::string& path = "");

/// Counts and logs a request that does not become a job; what its caller is told.
[[nodiscard]] grpc::Status refuse(const ServiceParts& parts, const Origin& origin, const Error& error);

/// What the caller of a stream that ends early is told: when to come back, if it is the server that leaves.
[[nodiscard]] grpc::Status end_of_stream(const ServiceParts& parts, const Error& error);

/// Checks everything about the request, which the job then keeps. Error fields are paths from the request's
/// root. The job has no observer yet.
[[nodiscard]] Expected<std::shared_ptr<Job>> make_job(const ServiceParts& parts, const Caller& caller,
                                                      JobKind kind,
                                                      std::shared_ptr<const v1::SolveRequest> request);

}  // namespace marble::server
