// One NumPy array, as it lies in an .npz archive.
#include "npy.h"

#include <cstdint>
#include <string_view>

#include "expect.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto array = marble::formats::parse_npy({reinterpret_cast<const char*>(data), size}, "fuzz");
  FUZZ_EXPECT(array || !array.error().message().empty());
  return 0;
}
