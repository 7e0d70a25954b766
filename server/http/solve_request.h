// Reads a request to solve from JSON, for POST /api/jobs.
#pragma once

#include <memory>
#include <string_view>

#include "marble/error.h"
#include "marble/v1/service.pb.h"

namespace marble::server::http {

/// {"problem": …} with the problem in the format of problem files and the other fields of v1::SolveRequest
/// in protobuf's JSON; or the problem alone. At most `most_bytes` as a message. Errors: invalid_argument,
/// with fields named as in the text; resource_exhausted.
[[nodiscard]] Expected<std::shared_ptr<v1::SolveRequest>> solve_request_of(std::string_view text,
                                                                           std::int64_t most_bytes);

}  // namespace marble::server::http
