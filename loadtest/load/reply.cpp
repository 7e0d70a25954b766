#include "reply.h"

#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include <array>

#include "google/rpc/error_details.pb.h"

namespace marble::load {
namespace {

constexpr std::array<const char*, 17> kCodes = {
    "ok",        "cancelled",      "unknown",           "invalid_argument",   "deadline_exceeded",
    "not_found", "already_exists", "permission_denied", "resource_exhausted", "failed_precondition",
    "aborted",   "out_of_range",   "unimplemented",     "internal",           "unavailable",
    "data_loss", "unauthenticated"};

}  // namespace

Reply error_reply(const google::rpc::Status& status) {
  Reply reply;
  const auto code = static_cast<std::size_t>(status.code());
  reply.error = code < kCodes.size() && code > 0 ? kCodes[code] : "unknown";
  reply.error_message = status.message();
  for (const auto& detail : status.details()) reply.retry_info |= detail.Is<google::rpc::RetryInfo>();
  return reply;
}

Reply error_reply(const grpc::Status& status) {
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) details.Clear();
  details.set_code(status.error_code());
  details.set_message(status.error_message());
  return error_reply(details);
}

Reply broken_reply(const std::string& why) {
  Reply reply;
  reply.error = "broken_answer";
  reply.error_message = why;
  return reply;
}

bool parse(grpc::ByteBuffer& bytes, google::protobuf::Message* message) {
  grpc::ProtoBufferReader reader(&bytes);
  const bool good = reader.status().ok() && message->ParseFromZeroCopyStream(&reader);
  bytes.Clear();
  return good;
}

}  // namespace marble::load
