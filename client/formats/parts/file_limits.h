// What a file may ask of memory: always in proportion to its own length, whatever sizes it tells.
#pragma once

#include <cstddef>

namespace marble::formats {

constexpr std::size_t kUnpackedBytes = std::size_t{64} << 20;  ///< that any file may unpack to
constexpr std::size_t kUnpackedFactor = 100;                   ///< of its length may come on top

/// Bytes that an array of a file of `length` bytes may have once it is unpacked.
[[nodiscard]] constexpr std::size_t most_bytes(std::size_t length) {
  return kUnpackedBytes + kUnpackedFactor * length;
}
/// Numbers that a table of it may have: eight bytes each.
[[nodiscard]] constexpr std::size_t most_numbers(std::size_t length) { return most_bytes(length) / 8; }

/// Rows or columns that one may have; an empty row takes more than a number.
[[nodiscard]] constexpr std::size_t most_rows(std::size_t length) {
  return (std::size_t{1} << 20) + kUnpackedFactor * length / 8;
}

}  // namespace marble::formats
