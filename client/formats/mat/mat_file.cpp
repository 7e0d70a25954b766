#include "mat/mat_file.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>

#include "parts/file_limits.h"

namespace marble::formats {
namespace {

constexpr std::size_t kHeader4 = 20, kHeader5 = 128;
constexpr std::size_t kNameIsWithin = 1024;  // bytes of a version 5 variable
constexpr std::uint32_t kCompressed = 15, kMatrix = 14;
constexpr std::uint32_t kSparseClass = 5, kDoubleClass = 6;
constexpr std::uint32_t kComplexFlag = 0x0800;

static_assert(std::endian::native == std::endian::little);

constexpr const char* kEndsTooSoon = "ends too soon";

template <class Number>
Number load(std::string_view bytes, std::size_t at, bool swapped) {
  std::array<char, sizeof(Number)> raw;
  std::memcpy(raw.data(), bytes.data() + at * sizeof(Number), sizeof(Number));
  if (swapped) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<Number>(raw);
}

// The storage type of numbers; for version 5, its type numbers.
enum class Storage : std::uint32_t {
  int8 = 1,
  uint8 = 2,
  int16 = 3,
  uint16 = 4,
  int32 = 5,
  uint32 = 6,
  single = 7,
  real = 9,
  int64 = 12,
  uint64 = 13
};

template <class Number>
std::optional<std::vector<double>> load_all(std::string_view bytes, std::size_t count, bool swapped) {
  if (bytes.size() / sizeof(Number) < count) return std::nullopt;
  std::vector<double> values(count);
  for (std::size_t k = 0; k < count; ++k) values[k] = static_cast<double>(load<Number>(bytes, k, swapped));
  return values;
}

std::size_t width_of(Storage storage) {
  switch (storage) {
    case Storage::int8:
    case Storage::uint8:
      return 1;
    case Storage::int16:
    case Storage::uint16:
      return 2;
    case Storage::int32:
    case Storage::uint32:
    case Storage::single:
      return 4;
    case Storage::real:
    case Storage::int64:
    case Storage::uint64:
      return 8;
  }
  return 0;
}

// Returns the first `count` numbers; nothing if there are fewer, or the type is not numeric.
std::optional<std::vector<double>> numbers(Storage storage, std::string_view bytes, std::size_t count,
                                           bool swapped) {
  switch (storage) {
    case Storage::int8:
      return load_all<std::int8_t>(bytes, count, swapped);
    case Storage::uint8:
      return load_all<std::uint8_t>(bytes, count, swapped);
    case Storage::int16:
      return load_all<std::int16_t>(bytes, count, swapped);
    case Storage::uint16:
      return load_all<std::uint16_t>(bytes, count, swapped);
    case Storage::int32:
      return load_all<std::int32_t>(bytes, count, swapped);
    case Storage::uint32:
      return load_all<std::uint32_t>(bytes, count, swapped);
    case Storage::single:
      return load_all<float>(bytes, count, swapped);
    case Storage::real:
      return load_all<double>(bytes, count, swapped);
    case Storage::int64:
      return load_all<std::int64_t>(bytes, count, swapped);
    case Storage::uint64:
      return load_all<std::uint64_t>(bytes, count, swapped);
  }
  return std::nullopt;
}

TableMatrix table_of_numbers(Index rows, Index columns, const std::vector<double>& values) {
  TableMatrix table{rows, columns};
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (values[k] != 0.0)
      table.entries.add(static_cast<Index>(k % static_cast<std::size_t>(rows)),
                        static_cast<Index>(k / static_cast<std::size_t>(rows)), values[k]);
  }
  return table;
}

// Returns up to `most` bytes of a zlib stream; those before an error in it.
std::string unpack(std::string_view packed, std::size_t most) {
  std::string bytes;
  z_stream stream = {};
  if (inflateInit(&stream) != Z_OK) return bytes;
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(std::min<std::size_t>(packed.size(), 0xffffffff));
  int state = Z_OK;
  while (state == Z_OK && bytes.size() < most) {
    const std::size_t before = bytes.size();
    const std::size_t room = std::min(most - before, std::clamp<std::size_t>(before, 4096, 1 << 26));
    bytes.resize(before + room);
    stream.next_out = reinterpret_cast<Bytef*>(bytes.data() + before);
    stream.avail_out = static_cast<uInt>(room);
    state = inflate(&stream, Z_NO_FLUSH);
    bytes.resize(before + room - stream.avail_out);
    if (bytes.size() == before) break;
  }
  inflateEnd(&stream);
  return bytes;
}

struct Element {
  std::uint32_t type = 0;
  std::string_view data;
};

// Iterates over the elements of version 5.
class Elements {
 public:
  Elements(std::string_view bytes, bool swapped) : rest_(bytes), swapped_(swapped) {}

  [[nodiscard]] bool at_end() const { return rest_.empty(); }
  [[nodiscard]] std::size_t left() const { return rest_.size(); }

  // Returns nothing if the element is cut off; with `partly`, its existing part.
  std::optional<Element> next(bool partly = false) {
    if (rest_.size() < 8) return std::nullopt;
    const auto type = load<std::uint32_t>(rest_, 0, swapped_);
    if (type >> 16 != 0) {  // a small element: size and data are in the tag
      const std::size_t size = type >> 16;
      if (size > 4) return std::nullopt;
      const Element element{type & 0xffff, rest_.substr(4, size)};
      rest_.remove_prefix(8);
      return element;
    }
    const std::size_t size = load<std::uint32_t>(rest_, 1, swapped_);
    if (size > rest_.size() - 8 && !partly) return std::nullopt;
    const Element element{type, rest_.substr(8, size)};
    const std::size_t padded = type == kCompressed ? size : (size + 7) / 8 * 8;
    rest_.remove_prefix(std::min(rest_.size(), 8 + padded));
    return element;
  }

 private:
  std::string_view rest_;
  bool swapped_;
};

// The header of a version 5 variable.
struct Head5 {
  std::uint32_t flags = 0;
  std::vector<std::int32_t> extents;
  std::string name;
};

std::optional<Head5> take_head(Elements& parts, bool swapped) {
  const auto flags = parts.next(), extents = parts.next(), name = parts.next();
  if (!flags || !extents || !name || flags->data.size() < 4) return std::nullopt;
  Head5 head{load<std::uint32_t>(flags->data, 0, swapped), {}, std::string(name->data)};
  for (std::size_t k = 0; k < extents->data.size() / 4; ++k)
    head.extents.push_back(load<std::int32_t>(extents->data, k, swapped));
  return head;
}

// True if a matrix in the file may have this size.
bool is_size(double value, std::size_t length) {
  return value >= 0.0 && value <= static_cast<double>(std::min<std::size_t>(most_rows(length), 0x7fffffff)) &&
         value == std::floor(value);
}

Expected<std::optional<TableMatrix>> read_version_5(std::string_view bytes, const std::string& name,
                                                    std::size_t length, bool swapped) {
  const auto refuse = [&](const std::string& value, const std::string& bound) {
    return unexpected(invalid(name, value, bound));
  };
  Elements parts(bytes, swapped);
  const auto head = take_head(parts, swapped);
  if (!head) return refuse("", kEndsTooSoon);
  if (head->extents.size() != 2 || !is_size(head->extents[0], length) || !is_size(head->extents[1], length)) {
    return refuse("", "must be a matrix or a vector with at most " + std::to_string(most_rows(length)) +
                          " rows and columns, for the file's length");
  }
  if ((head->flags & kComplexFlag) != 0) return refuse("complex", "must be real");
  const std::uint32_t kind = head->flags & 0xff;
  const Index rows = head->extents[0], columns = head->extents[1];
  if (rows == 0 || columns == 0) return TableMatrix{rows, columns};
  if (kind != kDoubleClass && kind != kSparseClass)
    return refuse("", "must be of class double, full or sparse");
  if (kind == kDoubleClass) {
    const auto data = parts.next();
    const std::size_t count = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
    if (!data || count > most_numbers(length)) return refuse("", kEndsTooSoon);
    const auto values = numbers(Storage{data->type}, data->data, count, swapped);
    if (!values) return refuse("", kEndsTooSoon);
    return table_of_numbers(rows, columns, *values);
  }
  const auto indices = parts.next(), starts = parts.next(), data = parts.next();
  if (!indices || !starts || !data) return refuse("", kEndsTooSoon);
  const auto integers = [&](const Element& element) {
    std::vector<std::uint32_t> values(element.data.size() / 4);
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = load<std::uint32_t>(element.data, k, swapped);
    return values;
  };
  const std::size_t width = width_of(Storage{data->type});
  const std::size_t count = width == 0 ? 0 : std::min(data->data.size() / width, indices->data.size() / 4);
  const auto values = numbers(Storage{data->type}, data->data, count, swapped);
  if (!values) return refuse("", "must hold numbers");
  return table_of_columns(name, rows, columns, integers(*starts), integers(*indices), *values);
}

// The header of a version 4 variable.
struct Head4 {
  std::uint32_t type = 0, rows = 0, columns = 0, imaginary = 0, name_length = 0;
  bool swapped = false;

  [[nodiscard]] static Head4 at(std::string_view bytes) {
    Head4 head;
    head.swapped = load<std::uint32_t>(bytes, 0, false) > 4999;  // the type's four digits, 0 to 4052
    std::uint32_t* const fields[] = {&head.type, &head.rows, &head.columns, &head.imaginary,
                                     &head.name_length};
    for (std::size_t k = 0; k < std::size(fields); ++k)
      *fields[k] = load<std::uint32_t>(bytes, k, head.swapped);
    return head;
  }
  [[nodiscard]] bool is_sparse() const { return type % 10 == 2; }
  [[nodiscard]] bool is_known() const { return type / 1000 <= 1 && type / 100 % 10 == 0 && type % 10 <= 2; }
  [[nodiscard]] Storage storage() const {
    constexpr Storage kStorages[] = {Storage::real,  Storage::single, Storage::int32,
                                     Storage::int16, Storage::uint16, Storage::uint8};
    const std::size_t digit = type / 10 % 10;
    return digit < std::size(kStorages) ? kStorages[digit] : Storage{0};
  }
};

Expected<std::optional<TableMatrix>> read_version_4(std::string_view bytes, const std::string& name,
                                                    std::size_t length) {
  const auto refuse = [&](const std::string& value, const std::string& bound) {
    return unexpected(invalid(name, value, bound));
  };
  const Head4 head = Head4::at(bytes);
  bytes.remove_prefix(kHeader4 + head.name_length);
  if (head.imaginary != 0) return refuse("complex", "must be real");
  if (head.type % 10 == 1) return refuse("text", "must hold numbers");
  if (head.rows == 0 || head.columns == 0) return TableMatrix{};
  // find_version_4 has checked that both are within the file.
  const std::size_t count = std::size_t{head.rows} * head.columns;
  const auto values = numbers(head.storage(), bytes, count, head.swapped);
  if (!values) return refuse("", kEndsTooSoon);
  if (!head.is_sparse()) {
    if (!is_size(head.rows, length) || !is_size(head.columns, length)) return refuse("", "is too large");
    return table_of_numbers(static_cast<Index>(head.rows), static_cast<Index>(head.columns), *values);
  }
  // Rows, columns and values are columns, counted from 1; the last entry of each is the size.
  if (head.columns == 4) return refuse("complex", "must be real");
  if (head.columns != 3) return refuse("", "must have three columns: it is sparse");
  const std::size_t last = head.rows - 1;
  const std::span<const double> row(values->data(), head.rows), column(row.data() + head.rows, head.rows),
      value(column.data() + head.rows, head.rows);
  if (!is_size(row[last], length) || !is_size(column[last], length)) {
    return refuse("", "must have at most " + std::to_string(most_rows(length)) +
                          " rows and columns, for the file's length");
  }
  TableMatrix table{static_cast<Index>(row[last]), static_cast<Index>(column[last])};
  for (std::size_t k = 0; k < last; ++k) {
    if (!(row[k] >= 1.0 && row[k] <= row[last] && column[k] >= 1.0 && column[k] <= column[last])) {
      return unexpected(invalid(
          name, static_cast<std::int64_t>(k), "",
          "must be an entry within " + std::to_string(table.rows) + " x " + std::to_string(table.columns)));
    }
    table.entries.add(static_cast<Index>(row[k]) - 1, static_cast<Index>(column[k]) - 1, value[k]);
  }
  return table;
}

Error fault_at(std::size_t byte, const std::string& bound) {
  return invalid("", "byte " + std::to_string(byte), bound);
}

}  // namespace

Expected<MatFile> MatFile::open(std::string_view bytes) {
  MatFile file(bytes);
  // Version 5 begins with a text of 116 bytes, version 4 with a small number.
  file.version_4_ = bytes.size() >= 4 && bytes.substr(0, 4).find('\0') != std::string_view::npos;
  const auto found = file.version_4_ ? file.find_version_4(bytes) : file.find_version_5(bytes);
  if (!found) return unexpected(found.error());
  return file;
}

Expected<void> MatFile::find_version_4(std::string_view bytes) {
  std::size_t at = 0;
  while (at < bytes.size()) {
    const std::string_view rest = bytes.substr(at);
    if (rest.size() < kHeader4) return unexpected(fault_at(at, kEndsTooSoon));
    const Head4 head = Head4::at(rest);
    const std::size_t width = width_of(head.storage());
    if (!head.is_known() || width == 0) return unexpected(fault_at(at, "is no variable of MATLAB 4"));
    const std::size_t parts = head.imaginary != 0 && !head.is_sparse() ? 2 : 1;
    const std::size_t after_name = kHeader4 + head.name_length;
    // Compares each factor separately: their product may overflow.
    std::size_t room = after_name <= rest.size() ? (rest.size() - after_name) / (width * parts) : 0;
    if (head.columns != 0) room /= head.columns;
    if (after_name > rest.size() || (head.columns != 0 && head.rows > room))
      return unexpected(fault_at(at, kEndsTooSoon));
    std::string_view name = rest.substr(kHeader4, head.name_length);
    name = name.substr(0, name.find('\0'));
    variables_.emplace(name, Place{rest});
    at += after_name + std::size_t{head.rows} * head.columns * width * parts;
  }
  return {};
}

Expected<void> MatFile::find_version_5(std::string_view bytes) {
  if (bytes.starts_with("# Created by Octave") || bytes.starts_with("Octave-1-")) {
    return unexpected(
        invalid("", "is a file of Octave's own: must be written in MATLAB's format, by save -v7 FILE"));
  }
  const std::string_view order = bytes.size() < kHeader5 ? "" : bytes.substr(126, 2);
  if (order != "IM" && order != "MI") return unexpected(invalid("", "cannot be read as a MATLAB file"));
  swapped_ = order == "MI";
  Elements elements(bytes.substr(kHeader5), swapped_);
  while (!elements.at_end()) {
    const std::size_t at = bytes.size() - elements.left();
    const auto element = elements.next();
    if (!element) return unexpected(fault_at(at, kEndsTooSoon));
    if (element->type != kCompressed && element->type != kMatrix) continue;
    const bool packed = element->type == kCompressed;
    std::string begin;
    Elements parts(element->data, swapped_);
    if (packed) {
      begin = unpack(element->data, kNameIsWithin);
      const auto matrix = Elements(begin, swapped_).next(true);
      if (!matrix || matrix->type != kMatrix) return unexpected(fault_at(at, "cannot be unpacked"));
      parts = Elements(matrix->data, swapped_);
    }
    if (auto head = take_head(parts, swapped_))
      variables_.emplace(std::move(head->name), Place{element->data, packed});
  }
  return {};
}

Expected<std::optional<TableMatrix>> MatFile::read(const std::string& name) const {
  const auto found = variables_.find(name);
  if (found == variables_.end()) return std::nullopt;
  const auto& [bytes, packed] = found->second;
  if (version_4_) return read_version_4(bytes, name, length_);
  if (!packed) return read_version_5(bytes, name, length_, swapped_);
  const std::string unpacked = unpack(bytes, most_bytes(length_));
  const auto matrix = Elements(unpacked, swapped_).next();
  if (!matrix) {
    const bool large = unpacked.size() == most_bytes(length_);
    return unexpected(invalid(name, "",
                              large ? "must unpack to at most " + std::to_string(most_bytes(length_)) +
                                          " bytes, for the file's length"
                                    : std::string(kEndsTooSoon)));
  }
  return read_version_5(matrix->data, name, length_, swapped_);
}

}  // namespace marble::formats
