// A problem as JSON: whatever is taken can be written and is then taken again.
#include <cstdint>
#include <string_view>

#include "expect.h"
#include "marble/problem_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace marble;
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  const auto file = parse_problem(content, FileFormat::json, "fuzz");
  if (!file) {
    FUZZ_EXPECT(!file.error().message().empty());
    return 0;
  }
  const std::string written = write_problem(*file, FileFormat::json);
  FUZZ_EXPECT(parse_problem(written, FileFormat::json, "fuzz").has_value());
  return 0;
}
