// A file of AMPL, text or binary.
#include <cstdint>
#include <string_view>

#include "expect.h"
#include "nl/nl_problem.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = marble::formats::parse_nl({reinterpret_cast<const char*>(data), size}, "fuzz");
  FUZZ_EXPECT(file || !file.error().message().empty());
  return 0;
}
