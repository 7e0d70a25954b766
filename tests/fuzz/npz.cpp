// An archive of NumPy arrays.
#include <cstdint>
#include <string_view>

#include "expect.h"
#include "npz_problem.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = marble::formats::parse_npz({reinterpret_cast<const char*>(data), size}, "fuzz");
  FUZZ_EXPECT(file || !file.error().message().empty());
  return 0;
}
