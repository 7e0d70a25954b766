// Reads and writes one NumPy array as .npy bytes: numpy.lib.format, versions 1.0 to 3.0.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "marble/error.h"

namespace marble::formats {

struct NpyArray {
  std::vector<std::size_t> shape;  ///< empty: a single number
  bool column_major = false;
  std::vector<double> values = {};  ///< for numbers and booleans
  std::string text = {};            ///< for a string array: its first element
};

/// Reads little-endian numbers of 4 and 8 bytes, booleans, and strings. The error's field is `name`.
[[nodiscard]] Expected<NpyArray> parse_npy(std::string_view bytes, const std::string& name);

/// Writes doubles, or 32-bit integers, in one dimension.
[[nodiscard]] std::string write_npy(const std::vector<double>& values);
[[nodiscard]] std::string write_npy(const std::vector<std::int32_t>& values);

}  // namespace marble::formats
