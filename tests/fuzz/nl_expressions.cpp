// A nonlinear file of AMPL's, text or binary: what is written again for AMPL's library is a file of its own
// right.
#include <cstdint>
#include <string_view>

#include "expect.h"
#include "nl/expression_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using marble::formats::read_expressions;
  const auto file = read_expressions({reinterpret_cast<const char*>(data), size}, {});
  if (!file) {
    FUZZ_EXPECT(!file.error().message().empty());
    return 0;
  }
  const auto again = read_expressions(file->content, {});
  FUZZ_EXPECT(again && again->content == file->content);
  return 0;
}
