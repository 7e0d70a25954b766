#include "base/random_id.h"

#include <absl/random/random.h>

#include <cstdint>
#include <limits>

namespace marble::server {

std::string random_id() {
  thread_local absl::BitGen generator;
  const auto bits = absl::Uniform<std::uint64_t>(absl::IntervalClosed, generator, 1,
                                                 std::numeric_limits<std::uint64_t>::max());
  std::string text(16, '0');
  for (int digit = 0; digit < 16; ++digit)
    text[static_cast<std::size_t>(digit)] = "0123456789abcdef"[bits >> (60 - 4 * digit) & 15];
  return text;
}

}  // namespace marble::server
