#include "npy.h"

#include <cstdint>
#include <cstring>
#include <optional>

namespace marble::formats {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kAlignment = 64;

// Returns the text between the quotes after the key, or up to the end of a tuple or word.
std::optional<std::string_view> value_of(std::string_view header, std::string_view key) {
  const std::size_t at = header.find(key);
  if (at == std::string_view::npos) return std::nullopt;
  const std::size_t colon = header.find(':', at);
  if (colon == std::string_view::npos) return std::nullopt;
  const std::size_t begin = header.find_first_not_of(' ', colon + 1);
  if (begin == std::string_view::npos) return std::nullopt;
  if (header[begin] == '\'' || header[begin] == '(') {
    const std::size_t end = header.find(header[begin] == '(' ? ')' : '\'', begin + 1);
    if (end == std::string_view::npos) return std::nullopt;
    return header.substr(begin + 1, end - begin - 1);
  }
  return header.substr(begin, header.find_first_of(",}", begin) - begin);
}

std::optional<std::vector<std::size_t>> shape_of(std::string_view text) {
  std::vector<std::size_t> shape;
  std::size_t value = 0;
  bool digits = false;
  for (const char c : std::string(text) + ",") {
    if (c >= '0' && c <= '9') {
      value = 10 * value + static_cast<std::size_t>(c - '0');
      if (value > 0x7fffffff) return std::nullopt;
      digits = true;
    } else if (c == ',' && digits) {
      shape.push_back(value);
      value = 0;
      digits = false;
    } else if (c != ' ' && c != ',') {
      return std::nullopt;
    }
  }
  return shape;
}

template <class Number>
void take(std::string_view bytes, std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    Number value;
    std::memcpy(&value, bytes.data() + i * sizeof value, sizeof value);
    values[i] = static_cast<double>(value);
  }
}

// Byte strings have one byte per letter, "U" strings four.
std::string text_of(std::string_view bytes, char kind) {
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += kind == 'U' ? 4 : 1) {
    if (bytes[i] != '\0') text += bytes[i];
  }
  return text;
}

template <class Number>
std::string write(const std::vector<Number>& values, const char* type) {
  std::string header = std::string("{'descr': '") + type + "', 'fortran_order': False, 'shape': (" +
                       std::to_string(values.size()) + ",), }";
  const std::size_t before = kMagic.size() + 4;
  header.resize((before + header.size() + 1 + kAlignment - 1) / kAlignment * kAlignment - before - 1, ' ');
  header += '\n';
  std::string bytes(kMagic);
  bytes += '\x01';
  bytes += '\0';
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Number));
  return bytes;
}

}  // namespace

Expected<NpyArray> parse_npy(std::string_view bytes, const std::string& name) {
  const auto refuse = [&](const std::string& value, const std::string& bound) {
    return unexpected(invalid(name, value, bound));
  };
  const std::size_t length_at = kMagic.size() + 2;
  if (bytes.substr(0, kMagic.size()) != kMagic || bytes.size() < length_at + 4)
    return refuse("", "is no NumPy array");
  const bool long_length = bytes[kMagic.size()] >= 2;
  const auto byte = [&](std::size_t i) {
    return static_cast<std::size_t>(static_cast<unsigned char>(bytes[i]));
  };
  std::size_t length = byte(length_at) | byte(length_at + 1) << 8;
  if (long_length) length |= byte(length_at + 2) << 16 | byte(length_at + 3) << 24;
  bytes.remove_prefix(length_at + (long_length ? 4 : 2));
  if (length > bytes.size()) return refuse("", "ends too soon");
  const std::string_view header = bytes.substr(0, length);
  bytes.remove_prefix(length);

  const auto type = value_of(header, "'descr'");
  const auto order = value_of(header, "'fortran_order'");
  const auto shape_text = value_of(header, "'shape'");
  const auto shape = shape_text ? shape_of(*shape_text) : std::nullopt;
  if (!type || type->size() < 3 || !order || !shape) return refuse("", "has a header that is not NumPy's");
  NpyArray array{*shape, order->substr(0, 4) == "True"};
  std::size_t count = 1;
  for (const std::size_t extent : array.shape) {
    if (extent != 0 && count > bytes.size() / extent) return refuse("", "ends too soon");
    count *= extent;
  }
  const std::string kind(type->substr(1));
  if (kind[0] == 'S' || kind[0] == 'U') {
    array.text = text_of(bytes, kind[0]);
    return array;
  }
  const std::size_t size = kind == "f8" || kind == "i8" || kind == "u8" ? 8 : kind == "b1" ? 1 : 4;
  if (bytes.size() / size < count) return refuse("", "ends too soon");
  array.values.resize(count);
  if ((*type)[0] == '>') return refuse(std::string(*type), "must be little-endian");
  if (kind == "f8") {
    take<double>(bytes, array.values);
  } else if (kind == "f4") {
    take<float>(bytes, array.values);
  } else if (kind == "i8") {
    take<std::int64_t>(bytes, array.values);
  } else if (kind == "i4") {
    take<std::int32_t>(bytes, array.values);
  } else if (kind == "u8") {
    take<std::uint64_t>(bytes, array.values);
  } else if (kind == "u4") {
    take<std::uint32_t>(bytes, array.values);
  } else if (kind == "b1") {
    take<std::uint8_t>(bytes, array.values);
  } else {
    return refuse(std::string(*type), "must be of type float64, float32, int64, int32 or bool");
  }
  return array;
}

std::string write_npy(const std::vector<double>& values) { return write(values, "<f8"); }
std::string write_npy(const std::vector<std::int32_t>& values) { return write(values, "<i4"); }

}  // namespace marble::formats
