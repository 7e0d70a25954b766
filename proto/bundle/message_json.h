// A message as protobuf's JSON, piece by piece: protobuf makes all of it in memory, where it takes forty
// times the message.
#pragma once

#include <google/protobuf/message.h>

#include <cstdint>
#include <functional>
#include <string_view>

namespace marble {

/// Takes the next piece of a text; false ends the writing.
using TextSink = std::function<bool(std::string_view)>;

/// Bytes of memory that the writing takes, but for the longest string that JSON must escape; a piece has
/// about half of them.
inline constexpr std::int64_t kJsonPieceBytes = 128 << 10;

/// Writes the message byte for byte as protobuf does with always_print_primitive_fields and
/// preserve_proto_field_names. The message must have no maps, which the contract does not use. False if the
/// sink ended it.
bool write_message_json(const google::protobuf::Message& message, const TextSink& sink);

/// How many bytes that is.
[[nodiscard]] std::uint64_t message_json_size(const google::protobuf::Message& message);

}  // namespace marble
