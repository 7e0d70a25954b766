// Replies from what gRPC gives.
#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/status.h>

#include "google/rpc/status.pb.h"
#include "measure/work.h"

namespace marble::load {

[[nodiscard]] Reply error_reply(const grpc::Status& status);
/// Of one request on a stream that goes on.
[[nodiscard]] Reply error_reply(const google::rpc::Status& status);
/// The server broke its contract, as far as one can see from here.
[[nodiscard]] Reply broken_reply(const std::string& why);

/// False if the bytes are no such message. Frees them.
[[nodiscard]] bool parse(grpc::ByteBuffer& bytes, google::protobuf::Message* message);

}  // namespace marble::load
