// Converts messages from and to bytes. The service parses its requests itself: gRPC would reply
// UNIMPLEMENTED to bytes that it cannot parse, and would own the message, which belongs to the job.
#pragma once

#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/wire_fields.h"

namespace marble::server {

/// Limit on the fields of a request, where an array of numbers counts as one: many times what the contract
/// has.
constexpr std::int64_t kMostFields = 1000;

/// Parses a call's request and frees its bytes, so that the call does not hold both. (gRPC passes a request
/// as const, but it belongs to the call alone, and no other code reads it.) Errors: invalid_argument (no
/// such message, or more than `most_fields`).
template <class Message>
[[nodiscard]] Expected<void> parse(const grpc::ByteBuffer* bytes, Message* message,
                                   std::int64_t most_fields = kMostFields) {
  auto* own = const_cast<grpc::ByteBuffer*>(bytes);
  // A field takes at least two bytes, so short messages, the most frequent ones, need no count.
  if (static_cast<std::int64_t>(own->Length()) > 2 * most_fields) {
    grpc::ProtoBufferReader reader(own);
    if (auto valid = check_fields(reader, *Message::descriptor(), most_fields); !valid) {
      own->Clear();
      return valid;
    }
  }
  const grpc::Status status = grpc::SerializationTraits<Message>::Deserialize(own, message);
  own->Clear();
  if (status.ok()) return {};
  return unexpected(failure(ErrorCode::invalid_argument,
                            "the request is not a " + Message::descriptor()->full_name() + " message"));
}

[[nodiscard]] inline std::string bytes_of(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  std::string bytes;
  if (!buffer.Dump(&slices).ok()) return bytes;
  bytes.reserve(buffer.Length());
  for (const grpc::Slice& slice : slices)
    bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return bytes;
}

template <class Message>
[[nodiscard]] grpc::ByteBuffer serialize(const Message& message) {
  grpc::ByteBuffer bytes;
  bool own = false;
  if (!grpc::SerializationTraits<Message>::Serialize(message, &bytes, &own).ok()) bytes.Clear();
  return bytes;
}

}  // namespace marble::server
