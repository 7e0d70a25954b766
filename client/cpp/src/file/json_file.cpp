#include "file/json_file.h"

#include "file/content.h"
#include "marble/json_problem.h"

namespace marble::client {

Expected<ProblemFile> parse_json_file(std::string_view content, const std::string& name) {
  auto read = parse_json(content, name);
  if (!read) return unexpected(read.error());
  return ProblemFile{std::move(read->problem), read->best_known_objective, false};
}

}  // namespace marble::client

namespace marble {

Expected<ProblemFile> read_json_problem(const std::string& path) {
  const auto content = client::read_content(path);
  if (!content) return unexpected(content.error());
  const std::string name = client::name_of_file(path);
  return or_out_of_memory([&] { return client::parse_json_file(*content, name); }, client::too_large_file);
}

}  // namespace marble
