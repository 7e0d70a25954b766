#include "marble/wire_fields.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <string>

#include "marble/composite/coupled.h"
#include "marble/v1/coupled.pb.h"

namespace marble {
namespace {

using google::protobuf::FieldDescriptor;
using Wire = google::protobuf::internal::WireFormatLite;

constexpr std::int64_t kBlockFields = 64;  // fields of a block, whose parts and coupling have 47

class FieldCounter {
 public:
  FieldCounter(google::protobuf::io::CodedInputStream& input, std::int64_t most)
      : input_(input), left_(most) {}

  /// False if there are too many, or if the bytes end early or cannot be parsed.
  bool count(const google::protobuf::Descriptor& type) {
    int last = 0, same = 0;  // how often in a row the last number came
    int groups = 0;          // open groups: all their fields are unknown, as the contract has no groups
    while (const std::uint32_t tag = input_.ReadTag()) {
      const auto wire = Wire::GetTagWireType(tag);
      if (wire == Wire::WIRETYPE_END_GROUP) {
        if (--groups < 0) return false;
        continue;
      }
      const int number = Wire::GetTagFieldNumber(tag);
      same = number == last ? same + 1 : 0;
      last = number;
      const FieldDescriptor* field = groups > 0 ? nullptr : type.FindFieldByNumber(number);
      if (!is_array(field, wire) && --left_ < 0) return false_at(field, number, same);
      if (wire == Wire::WIRETYPE_START_GROUP) {
        ++groups;
      } else if (!pass(wire, field)) {
        return false_at(field, number, same);
      }
    }
    return input_.ConsumedEntireMessage();
  }

  [[nodiscard]] bool too_many() const { return left_ < 0; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  // Numbers are stored in an array; anything that is no number of its type is kept as an unknown field.
  static bool is_array(const FieldDescriptor* field, Wire::WireType wire) {
    return field != nullptr && field->is_packable() &&
           (wire == Wire::WIRETYPE_LENGTH_DELIMITED ||
            wire == Wire::WireTypeForFieldType(static_cast<Wire::FieldType>(field->type())));
  }

  bool pass(Wire::WireType wire, const FieldDescriptor* field) {
    std::uint64_t number = 0;
    std::uint32_t size = 0;
    switch (wire) {
      case Wire::WIRETYPE_VARINT:
        return input_.ReadVarint64(&number);
      case Wire::WIRETYPE_FIXED64:
        return input_.Skip(sizeof(std::uint64_t));
      case Wire::WIRETYPE_FIXED32:
        return input_.Skip(sizeof(std::uint32_t));
      case Wire::WIRETYPE_LENGTH_DELIMITED:
        if (!input_.ReadVarint32(&size) || size > INT32_MAX) return false;
        return field != nullptr && field->message_type() != nullptr ? enter(*field->message_type(), size)
                                                                    : input_.Skip(static_cast<int>(size));
      default:
        return false;
    }
  }

  bool enter(const google::protobuf::Descriptor& type, std::uint32_t size) {
    if (&type == v1::CoupledBlock::descriptor() && blocks_++ < kMostBlocks) left_ += kBlockFields;
    const auto limit = input_.PushLimit(static_cast<int>(size));
    const bool done = count(type);
    input_.PopLimit(limit);
    return done;
  }

  bool false_at(const FieldDescriptor* field, int number, int same) {
    std::string name = field == nullptr ? std::to_string(number) : field->name();
    if (field == nullptr || field->is_repeated()) name += "[" + std::to_string(same) + "]";
    path_ = name + (path_.empty() ? "" : ".") + path_;
    return false;
  }

  google::protobuf::io::CodedInputStream& input_;
  std::int64_t left_;
  std::size_t blocks_ = 0;
  std::string path_;
};

}  // namespace

Expected<void> check_fields(google::protobuf::io::ZeroCopyInputStream& bytes,
                            const google::protobuf::Descriptor& type, std::int64_t most) {
  google::protobuf::io::CodedInputStream input(&bytes);
  FieldCounter counter(input, most);
  if (counter.count(type) || !counter.too_many()) return {};
  return unexpected(
      invalid(counter.path(), "is beyond the " + std::to_string(most) +
                                  " fields that the message may have, an array of numbers counted as one"));
}

}  // namespace marble
