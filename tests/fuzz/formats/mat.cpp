// A file of MATLAB 4, 5, 6 or 7.
#include <cstdint>
#include <string_view>

#include "expect.h"
#include "mat/mat_problem.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = marble::formats::parse_mat({reinterpret_cast<const char*>(data), size}, "fuzz");
  FUZZ_EXPECT(file || !file.error().message().empty());
  return 0;
}
