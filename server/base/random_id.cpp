#include "base/random_id.h"

#include <absl/random/random.h>

#include <cstdint>
#include <cstdio>
#include <limits>

namespace marble::server {

std::string random_id() {
  thread_local absl::BitGen generator;
  const auto bits = absl::Uniform<std::uint64_t>(absl::IntervalClosed, generator, 1,
                                                 std::numeric_limits<std::uint64_t>::max());
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(bits));
  return text;
}

}  // namespace marble::server
