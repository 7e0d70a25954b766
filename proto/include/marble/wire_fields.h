// How much a message would become when it is parsed. Two bytes on the wire may become forty of memory:
// fields, known or not, are counted before any of them is made.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/zero_copy_stream.h>

#include "marble/error.h"

namespace marble {

/// Errors: invalid_argument if the bytes hold more than `most` fields of a message of this type, those of its
/// parts and of groups among them and an array of numbers as one, but for 64 that each block of a coupled
/// problem may have of its own; the field says where. What cannot be parsed is left to the parser.
[[nodiscard]] Expected<void> check_fields(google::protobuf::io::ZeroCopyInputStream& bytes,
                                          const google::protobuf::Descriptor& type, std::int64_t most);

}  // namespace marble
