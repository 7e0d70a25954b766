#include "message_json.h"

#include <google/protobuf/reflection.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/wrappers.pb.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

namespace marble {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

constexpr std::size_t kPiece = kJsonPieceBytes / 2;

// Whether JSON has the text as it is.
bool is_plain(std::string_view text) {
  return std::ranges::all_of(
      text, [](char c) { return c >= ' ' && c <= '~' && c != '"' && c != '\\' && c != '<' && c != '>'; });
}

class Writer {
 public:
  explicit Writer(const TextSink& sink) : sink_(sink) {}

  void message(const Message& message) {
    // Any, durations and wrappers have forms of their own, and are short.
    if (message.GetDescriptor()->full_name().starts_with("google.protobuf.")) return library(message);
    const Reflection& reflection = *message.GetReflection();
    const auto& type = *message.GetDescriptor();
    text("{");
    bool first = true;
    for (int i = 0; i < type.field_count() && wanted_; ++i) {
      const FieldDescriptor& field = *type.field(i);
      const bool nested = field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
      if (field.is_repeated()) {
        name(field, first);
        list(message, reflection, field);
      } else if (nested ? reflection.HasField(message, &field) : field.containing_oneof() == nullptr) {
        name(field, first);
        value(message, reflection, field);
      }
    }
    // Scalars that know whether they are present come last, by number.
    if (type.oneof_decl_count() > 0) optional(message, reflection, first);
    text("}");
  }
  bool finish() {
    flush();
    return wanted_;
  }

 private:
  void optional(const Message& message, const Reflection& reflection, bool& first) {
    std::vector<const FieldDescriptor*> present;
    reflection.ListFields(message, &present);
    for (const FieldDescriptor* field : present) {
      if (field->containing_oneof() == nullptr || field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE)
        continue;
      name(*field, first);
      value(message, reflection, *field);
    }
  }

  void name(const FieldDescriptor& field, bool& first) {
    text(first ? "\"" : ",\"");
    first = false;
    text(field.name());
    text("\":");
  }

  void value(const Message& message, const Reflection& reflection, const FieldDescriptor& field) {
    std::string scratch;
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return number(reflection.GetDouble(message, &field));
      case FieldDescriptor::CPPTYPE_FLOAT:
        return number(reflection.GetFloat(message, &field));
      case FieldDescriptor::CPPTYPE_INT32:
        return number(reflection.GetInt32(message, &field));
      case FieldDescriptor::CPPTYPE_UINT32:
        return number(reflection.GetUInt32(message, &field));
      case FieldDescriptor::CPPTYPE_INT64:
        return number(reflection.GetInt64(message, &field));
      case FieldDescriptor::CPPTYPE_UINT64:
        return number(reflection.GetUInt64(message, &field));
      case FieldDescriptor::CPPTYPE_BOOL:
        return number(reflection.GetBool(message, &field));
      case FieldDescriptor::CPPTYPE_ENUM:
        return enumerator(field, reflection.GetEnumValue(message, &field));
      case FieldDescriptor::CPPTYPE_STRING:
        return string(field, reflection.GetStringReference(message, &field, &scratch));
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return this->message(reflection.GetMessage(message, &field));
      default:
        return;  // none is left
    }
  }

  void list(const Message& message, const Reflection& reflection, const FieldDescriptor& field) {
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return numbers(reflection.GetRepeatedFieldRef<double>(message, &field));
      case FieldDescriptor::CPPTYPE_FLOAT:
        return numbers(reflection.GetRepeatedFieldRef<float>(message, &field));
      case FieldDescriptor::CPPTYPE_INT32:
        return numbers(reflection.GetRepeatedFieldRef<std::int32_t>(message, &field));
      case FieldDescriptor::CPPTYPE_UINT32:
        return numbers(reflection.GetRepeatedFieldRef<std::uint32_t>(message, &field));
      case FieldDescriptor::CPPTYPE_INT64:
        return numbers(reflection.GetRepeatedFieldRef<std::int64_t>(message, &field));
      case FieldDescriptor::CPPTYPE_UINT64:
        return numbers(reflection.GetRepeatedFieldRef<std::uint64_t>(message, &field));
      case FieldDescriptor::CPPTYPE_BOOL:
        return numbers(reflection.GetRepeatedFieldRef<bool>(message, &field));
      default:
        break;
    }
    std::string scratch;
    array(reflection.FieldSize(message, &field), [&](int k) {
      if (field.cpp_type() == FieldDescriptor::CPPTYPE_ENUM) {
        enumerator(field, reflection.GetRepeatedEnumValue(message, &field, k));
      } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
        string(field, reflection.GetRepeatedStringReference(message, &field, k, &scratch));
      } else {
        this->message(reflection.GetRepeatedMessage(message, &field, k));
      }
    });
  }
  template <class Numbers>
  void numbers(const Numbers& all) {
    array(all.size(), [&](int k) { number(all.Get(k)); });
  }
  template <class Put>
  void array(int count, const Put& put) {
    text("[");
    for (int k = 0; k < count && wanted_; ++k) {
      if (k > 0) text(",");
      put(k);
    }
    text("]");
  }

  void number(bool value) { text(value ? "true" : "false"); }
  void number(std::int32_t value) { digits(value); }
  void number(std::uint32_t value) { digits(value); }
  void number(std::int64_t value) { quoted(value); }
  void number(std::uint64_t value) { quoted(value); }
  void number(float value) {
    real(value, std::numeric_limits<float>::digits10, std::numeric_limits<float>::max_digits10);
  }
  void number(double value) {
    real(value, std::numeric_limits<double>::digits10, std::numeric_limits<double>::max_digits10);
  }
  // The fewer digits where they are enough; of the smallest floats the library takes all.
  template <class Real>
  void real(Real value, int enough, int all) {
    if (std::isnan(value)) return text("\"NaN\"");
    if (std::isinf(value)) return text(value > 0.0 ? "\"Infinity\"" : "\"-Infinity\"");
    std::array<char, 40> room;
    char* const begin = room.data();
    char* const end = begin + room.size();
    char* at = std::to_chars(begin, end, value, std::chars_format::general, enough).ptr;
    Real back = 0;
    const auto read = std::from_chars(begin, at, back);
    const bool tiny = std::is_same_v<Real, float> && std::fpclassify(value) == FP_SUBNORMAL;
    if (read.ec != std::errc() || back != value || tiny)
      at = std::to_chars(begin, end, value, std::chars_format::general, all).ptr;
    text({begin, static_cast<std::size_t>(at - begin)});
  }
  template <class Integer>
  void digits(Integer value) {
    std::array<char, 24> room;
    const auto end = std::to_chars(room.data(), room.data() + room.size(), value).ptr;
    text({room.data(), static_cast<std::size_t>(end - room.data())});
  }
  template <class Integer>
  void quoted(Integer value) {
    text("\"");
    digits(value);
    text("\"");
  }
  void enumerator(const FieldDescriptor& field, int value) {
    const auto* known = field.enum_type()->FindValueByNumber(value);
    if (known == nullptr) return digits(value);
    text("\"");
    text(known->name());
    text("\"");
  }
  void string(const FieldDescriptor& field, const std::string& value) {
    if (field.type() == FieldDescriptor::TYPE_BYTES) {
      google::protobuf::BytesValue whole;
      whole.set_value(value);
      return library(whole);
    }
    if (!is_plain(value)) {
      google::protobuf::StringValue whole;
      whole.set_value(value);
      return library(whole);
    }
    text("\"");
    text(value);
    text("\"");
  }

  void library(const Message& message) {
    google::protobuf::util::JsonPrintOptions options;
    options.preserve_proto_field_names = true;
    options.always_print_primitive_fields = true;
    std::string all;
    const auto status = google::protobuf::util::MessageToJsonString(message, &all, options);
    text(status.ok() ? all : "null");
  }

  void text(std::string_view text) {
    for (; !text.empty(); text.remove_prefix(std::min(text.size(), kPiece))) {
      buffer_ += text.substr(0, kPiece);
      if (buffer_.size() >= kPiece) flush();
    }
  }
  void flush() {
    if (wanted_ && !buffer_.empty()) wanted_ = sink_(buffer_);
    buffer_.clear();
  }

  const TextSink& sink_;
  std::string buffer_;
  bool wanted_ = true;
};

}  // namespace

bool write_message_json(const Message& message, const TextSink& sink) {
  Writer writer(sink);
  writer.message(message);
  return writer.finish();
}

std::uint64_t message_json_size(const Message& message) {
  std::uint64_t size = 0;
  write_message_json(message, [&](std::string_view piece) {
    size += piece.size();
    return true;
  });
  return size;
}

}  // namespace marble
