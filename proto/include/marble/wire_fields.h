// Bounds the memory of a message before it is parsed. Two bytes on the wire may become forty in memory:
// fields, known or not, are counted before any of them is created.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/zero_copy_stream.h>

#include "marble/error.h"

namespace marble {

/// Errors: invalid_argument if the bytes hold more than `most` fields of a message of this type, including
/// those of its parts and of groups, with an array of numbers as one, and except for 64 that each block of a
/// coupled problem may have of its own; the field names the place. Bytes that cannot be parsed are left to
/// the parser.
[[nodiscard]] Expected<void> check_fields(google::protobuf::io::ZeroCopyInputStream& bytes,
                                          const google::protobuf::Descriptor& type, std::int64_t most);

}  // namespace marble
