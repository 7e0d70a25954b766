// The names that a JSON problem gives its parts: as many as there are, or an error that names the field.
#include <cstdint>
#include <string>

#include "expect.h"
#include "marble/problem_file.h"
#include "output/problem_names.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace marble;
  const std::string content(reinterpret_cast<const char*>(data), size);
  const auto file = parse_problem(content, FileFormat::json, "fuzz");
  OwnedProblem problem;
  if (file) problem = file->problem;
  const auto names = cli::names_of_json(content, problem);
  if (!names) {
    FUZZ_EXPECT(names.error().field.starts_with("names"));
    FUZZ_EXPECT(!names.error().message().empty());
    return 0;
  }
  FUZZ_EXPECT(names->variables.empty() || names->variables.size() == problem.g.size());
  FUZZ_EXPECT(names->equalities.empty() || names->equalities.size() == problem.b.size());
  FUZZ_EXPECT(names->inequalities.empty() || names->inequalities.size() == problem.d.size());
  FUZZ_EXPECT(names->pairs.empty() || names->pairs.size() == problem.l.size());
  return 0;
}
