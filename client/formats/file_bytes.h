// Reads a file as bytes.
#pragma once

#include <cstddef>
#include <string>

#include "marble/error.h"

namespace marble::formats {

/// Errors: not_found if it cannot be read.
[[nodiscard]] Expected<std::string> read_bytes(const std::string& path);

// Limits a file's memory in proportion to its own length, whatever sizes it declares.
constexpr std::size_t kUnpackedBytes = std::size_t{64} << 20;  ///< any file may unpack to this
constexpr std::size_t kUnpackedFactor = 100;                   ///< plus this multiple of its length

/// Returns the most bytes that an unpacked array of a file of `length` bytes may have.
[[nodiscard]] constexpr std::size_t most_bytes(std::size_t length) {
  return kUnpackedBytes + kUnpackedFactor * length;
}
/// Returns the most numbers that a table of it may have: eight bytes each.
[[nodiscard]] constexpr std::size_t most_numbers(std::size_t length) { return most_bytes(length) / 8; }

/// Returns the most rows or columns of a table; an empty row takes more than a number.
[[nodiscard]] constexpr std::size_t most_rows(std::size_t length) {
  return (std::size_t{1} << 20) + kUnpackedFactor * length / 8;
}

}  // namespace marble::formats
