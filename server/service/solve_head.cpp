#include "service/solve_head.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include <string>
#include <utility>

#include "base/wire.h"

namespace marble::server {
namespace {

using Wire = google::protobuf::internal::WireFormatLite;

class HeadReader {
 public:
  explicit HeadReader(const grpc::ByteBuffer& bytes)
      : size_(static_cast<std::int64_t>(bytes.Length())),
        reader_(const_cast<grpc::ByteBuffer*>(&bytes)),  // which it does not change
        stream_(&reader_) {}

  // Reads the outer message. The parts of a request that is divided among several fields add up.
  [[nodiscard]] bool read_outer(int field) {
    while (const std::uint32_t tag = stream_.ReadTag()) {
      std::uint32_t size = 0;
      if (!is_allowed(tag)) return false;
      if (tag != Wire::MakeTag(field, Wire::WIRETYPE_LENGTH_DELIMITED)) {
        if (!Wire::SkipField(&stream_, tag)) return false;
      } else if (!read_size(&size)) {
        return false;
      } else {
        const auto outer = stream_.PushLimit(static_cast<int>(size));
        if (!read()) return false;
        stream_.PopLimit(outer);
        head.bytes += size;
      }
    }
    return stream_.ConsumedEntireMessage();
  }

  // Reads the request, up to the current limit.
  [[nodiscard]] bool read() {
    while (const std::uint32_t tag = stream_.ReadTag()) {
      if (!is_allowed(tag) || !read_field(tag)) return false;
    }
    return stream_.ConsumedEntireMessage();
  }

  SolveHead head;

 private:
  // The contract has no groups, and one may have any number of fields.
  [[nodiscard]] bool is_allowed(std::uint32_t tag) {
    return --fields_left_ >= 0 && Wire::GetTagWireType(tag) != Wire::WIRETYPE_START_GROUP;
  }

  // False if the bytes end before.
  [[nodiscard]] bool read_size(std::uint32_t* size) {
    return stream_.ReadVarint32(size) && *size <= size_ - stream_.CurrentPosition();
  }

  // A field of another wire type is an unknown one.
  [[nodiscard]] bool read_field(std::uint32_t tag) {
    std::uint32_t number = 0;
    std::string bytes;
    switch (tag) {
      case Wire::MakeTag(v1::SolveRequest::kOptionsFieldNumber, Wire::WIRETYPE_LENGTH_DELIMITED):
        return read_bytes(&bytes) && head.fields.mutable_options()->MergeFromString(bytes);
      case Wire::MakeTag(v1::SolveRequest::kRequestIdFieldNumber, Wire::WIRETYPE_LENGTH_DELIMITED):
        if (!read_bytes(&bytes)) return false;
        head.fields.set_request_id(std::move(bytes));
        return true;
      case Wire::MakeTag(v1::SolveRequest::kPriorityFieldNumber, Wire::WIRETYPE_VARINT):
        if (!stream_.ReadVarint32(&number)) return false;
        head.fields.set_priority(static_cast<v1::Priority>(number));
        return true;
      default:
        return Wire::SkipField(&stream_, tag);
    }
  }

  [[nodiscard]] bool read_bytes(std::string* bytes) {
    std::uint32_t size = 0;
    if (!read_size(&size) || size > bytes_left_) return false;
    bytes_left_ -= size;
    return stream_.ReadString(bytes, static_cast<int>(size));
  }

  const std::int64_t size_;
  grpc::ProtoBufferReader reader_;
  google::protobuf::io::CodedInputStream stream_;
  std::int64_t fields_left_ = kMostFields;
  std::uint32_t bytes_left_ = kMostHeadBytes;
};

}  // namespace

std::optional<SolveHead> read_head(const grpc::ByteBuffer& bytes, int field) {
  HeadReader reader(bytes);
  reader.head.bytes = field == 0 ? static_cast<std::int64_t>(bytes.Length()) : 0;
  if (field == 0 ? !reader.read() : !reader.read_outer(field)) return std::nullopt;
  return std::move(reader.head);
}

}  // namespace marble::server
