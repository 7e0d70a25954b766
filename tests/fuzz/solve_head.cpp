// The head of a request to solve, from bytes. Whenever the bytes can be parsed as a whole, the head says the
// same as the message. The lowest bit of the first byte says whether the request is inside a
// SolveStreamRequest; the others say where the second piece of the buffer begins.
#include "service/solve_head.h"

#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/unknown_field_set.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "base/wire.h"
#include "expect.h"

namespace {

using namespace marble;
using server::read_head;
using server::SolveHead;

grpc::ByteBuffer buffer_of(const std::uint8_t* data, std::size_t size, std::size_t first) {
  const std::vector<grpc::Slice> slices = {grpc::Slice(data, first), grpc::Slice(data + first, size - first)};
  return {slices.data(), slices.size()};
}

bool has_group(const google::protobuf::Message& message) {
  const auto& unknown = message.GetReflection()->GetUnknownFields(message);
  for (int k = 0; k < unknown.field_count(); ++k) {
    if (unknown.field(k).type() == google::protobuf::UnknownField::TYPE_GROUP) return true;
  }
  return false;
}

void expect_same(const v1::SolveRequest& head, const v1::SolveRequest& whole) {
  FUZZ_EXPECT(head.priority() == whole.priority());
  FUZZ_EXPECT(head.request_id() == whole.request_id());
  FUZZ_EXPECT(head.has_options() == whole.has_options());
  FUZZ_EXPECT(head.options().SerializeAsString() == whole.options().SerializeAsString());
}

template <class Message, class RequestOf>
void compare(const grpc::ByteBuffer& bytes, int field, const RequestOf& request_of) {
  const std::string before = server::bytes_of(bytes);
  const auto head = read_head(bytes, field);
  FUZZ_EXPECT(server::bytes_of(bytes) == before);
  Message message;
  if (!message.ParseFromString(before)) return;
  const v1::SolveRequest& whole = request_of(message);
  // So short that neither its fields nor their bytes can be too many, also if it is written anew.
  const bool must_be_read =
      before.size() <= 2 * server::kMostFields && !has_group(message) && !has_group(whole);
  FUZZ_EXPECT(head.has_value() || !must_be_read);
  if (!head) return;
  expect_same(head->fields, whole);
  FUZZ_EXPECT(head->bytes <= static_cast<std::int64_t>(before.size()));
  if (field == 0) FUZZ_EXPECT(head->bytes == static_cast<std::int64_t>(before.size()));
  // As clients write it, its size is the one that its job has.
  const auto written = read_head(server::serialize(message), field);
  FUZZ_EXPECT(written.has_value() || !must_be_read);
  if (!written) return;
  expect_same(written->fields, whole);
  FUZZ_EXPECT(written->bytes == static_cast<std::int64_t>(whole.ByteSizeLong()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const google::protobuf::LogSilencer silence;
  if (size == 0) return 0;
  const std::size_t first = std::min<std::size_t>(data[0] / 2, size - 1);
  const grpc::ByteBuffer bytes = buffer_of(data + 1, size - 1, first);
  if (data[0] % 2 == 0) {
    compare<v1::SolveRequest>(
        bytes, 0, [](const auto& message) -> const auto& { return message; });
  } else {
    compare<v1::SolveStreamRequest>(
        bytes, v1::SolveStreamRequest::kSolveFieldNumber,
        [](const auto& message) -> const auto& { return message.solve(); });
  }
  return 0;
}
