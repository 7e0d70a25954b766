// A folder of Matrix Market files: parts follow one another, each after a line "@NAME".
#include <cstdint>
#include <string_view>

#include "expect.h"
#include "matrix_market.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  marble::formats::MatrixMarketParts parts;
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  std::string* part = nullptr;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size() - 1) + 1;
    const std::string_view line = rest.substr(0, end);
    if (line[0] == '@') {
      part = &parts[std::string(line.substr(1, line.find_last_not_of('\n')))];
    } else if (part != nullptr) {
      *part += line;
    }
    rest.remove_prefix(end);
  }
  const auto file = marble::formats::parse_matrix_market(parts, "fuzz");
  FUZZ_EXPECT(file || !file.error().message().empty());
  return 0;
}
