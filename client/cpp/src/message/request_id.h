// Provides the id of a submission for which the caller gave none.
#pragma once

#include <cstdint>
#include <random>
#include <string>

namespace marble::client {

/// Returns 128 random bits: with them a repeated submission is the same job (SolveRequest.request_id).
[[nodiscard]] inline std::string random_request_id() {
  std::random_device random;
  std::string id = "submit-";
  for (int word = 0; word < 4; ++word) {
    const std::uint32_t bits = random();
    for (int digit = 0; digit < 8; ++digit) id += "0123456789abcdef"[(bits >> (4 * digit)) & 0xFU];
  }
  return id;
}

}  // namespace marble::client
