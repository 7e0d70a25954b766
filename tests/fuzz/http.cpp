// A request of the HTTP port as it comes over a socket: an answer in HTTP, or none where nothing that could
// be answered came. Its server has no jobs and no room for one; http_jobs has.
#include <cstdint>

#include "http_port.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static marble::fuzz::HttpPort port;
  const std::string answer = port.answer({reinterpret_cast<const char*>(data), size});
  if (answer.empty()) return 0;
  FUZZ_EXPECT(answer.starts_with("HTTP/1.1 "));
  FUZZ_EXPECT(!answer.starts_with("HTTP/1.1 5"));
  return 0;
}
