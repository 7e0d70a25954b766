// Converts gRPC results to replies.
#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/status.h>

#include "google/rpc/status.pb.h"
#include "work.h"

namespace marble::load {

[[nodiscard]] Reply error_reply(const grpc::Status& status);
/// Returns the reply of one failed request on a stream that continues.
[[nodiscard]] Reply error_reply(const google::rpc::Status& status);
/// Returns the reply for a server that broke its contract, as far as the client can see.
[[nodiscard]] Reply broken_reply(const std::string& why);

/// Returns false if the bytes are not such a message. Frees them.
[[nodiscard]] bool parse(grpc::ByteBuffer& bytes, google::protobuf::Message* message);

}  // namespace marble::load
