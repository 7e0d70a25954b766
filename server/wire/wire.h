// Messages from and to bytes. The service parses its requests itself: gRPC would answer what it cannot parse
// with UNIMPLEMENTED, and would own the message, which here belongs to the job.
#pragma once

#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/wire_fields.h"

namespace marble::server {

/// Fields that a request may have, an array of numbers counted as one: many times what the contract has.
constexpr std::int64_t kMostFields = 1000;

/// Parses a call's request and frees its bytes, so that both are not held for the time of the call. (gRPC
/// shows a request as const, but it is the call's own, and nobody else looks at it.)
/// Errors: invalid_argument (no such message, or more than `most_fields`).
template <class Message>
[[nodiscard]] Expected<void> parse(const grpc::ByteBuffer* bytes, Message* message,
                                   std::int64_t most_fields = kMostFields) {
  auto* own = const_cast<grpc::ByteBuffer*>(bytes);
  // A field takes two bytes at least: short messages, the most frequent ones, need not be looked through.
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
