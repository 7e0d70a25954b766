// Reads the fields of a request to solve that decide when it runs, without the rest of the request.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <cstdint>
#include <optional>

#include "marble/v1/service.pb.h"

namespace marble::server {

struct SolveHead {
  v1::SolveRequest fields;  ///< options, request_id and priority, with the values that the whole request has
  std::int64_t bytes = 0;   ///< of the whole request, as it was sent
};

/// Skips everything else, such as the problem, and does not change the buffer. `field` is the number of the
/// outer message's field that contains the request; 0 if the bytes are the request. Nothing if the request
/// cannot be read in a few steps: it has a group, more than kMostFields fields or more than kMostHeadBytes of
/// the fields above, or its fields do not fit into its bytes. Only the parser of the whole request finds
/// everything that is wrong with it.
[[nodiscard]] std::optional<SolveHead> read_head(const grpc::ByteBuffer& bytes, int field = 0);

constexpr int kMostHeadBytes = 4096;

}  // namespace marble::server
