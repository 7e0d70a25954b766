// A replay bundle: whatever is taken can be written and is then taken again. After an odd byte the input is
// the archive within, which is packed here: else hardly any would get past zstd's own checks.
#include "bundle.h"

#include <zstd.h>

#include <cstdint>
#include <string>

#include "expect.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace marble;
  if (size == 0) return 0;
  std::string file(reinterpret_cast<const char*>(data + 1), size - 1);
  if (data[0] % 2 == 1) {
    std::string packed(ZSTD_compressBound(file.size()), '\0');
    packed.resize(ZSTD_compress(packed.data(), packed.size(), file.data(), file.size(), 1));
    file.swap(packed);
  }
  const auto bundle = read_bundle(file);
  if (!bundle) {
    FUZZ_EXPECT(!bundle.error().message().empty());
    return 0;
  }
  std::string written;
  const auto wrote = write_bundle(*bundle, [&](std::string_view bytes) -> Expected<void> {
    written += bytes;
    return {};
  });
  if (!wrote) return 0;  // its request or its answer is no such message
  const auto again = read_bundle(written);
  FUZZ_EXPECT(again.has_value());
  FUZZ_EXPECT(again->request == bundle->request && again->answer == bundle->answer);
  return 0;
}
