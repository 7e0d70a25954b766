// A request to solve as JSON, as POST /api/jobs takes it.
#pragma once

#include <memory>
#include <string_view>

#include "marble/error.h"
#include "marble/v1/service.pb.h"

namespace marble::server::http {

/// {"problem": …} with the problem as problem files have it and the other fields of v1::SolveRequest as
/// protobuf's JSON; or the problem alone. At most `most_bytes` as a message. Errors: invalid_argument, with
/// fields as the text has them; resource_exhausted.
[[nodiscard]] Expected<std::shared_ptr<v1::SolveRequest>> solve_request_of(std::string_view text,
                                                                           std::int64_t most_bytes);

}  // namespace marble::server::http
