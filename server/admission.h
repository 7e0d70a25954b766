// From a request's message to a validated job.
#pragma once

#include <grpcpp/server_context.h>

#include <memory>

#include "job.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

/// Checks everything about the request, which the job then keeps. Error fields are paths from the request's
/// root.
[[nodiscard]] Expected<std::shared_ptr<Job>> make_job(std::shared_ptr<const v1::SolveRequest> request,
                                                      const grpc::CallbackServerContext& context);

}  // namespace marble::server
