#include "file/content.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "marble/json_problem.h"

namespace marble::client {
namespace {

Error unreadable(const std::string& why) { return failure(ErrorCode::not_found, "cannot be read: " + why); }

Expected<std::string> read_all(std::FILE* file) {
  std::string content;
  char chunk[1 << 16];
  while (const std::size_t count = std::fread(chunk, 1, sizeof chunk, file)) content.append(chunk, count);
  if (std::ferror(file) != 0) return unexpected(unreadable(std::strerror(errno)));
  return content;
}

Expected<std::string> read_path(const std::string& path) {
  if (path == "-") return read_all(stdin);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"), &std::fclose);
  if (file == nullptr) return unexpected(unreadable(std::strerror(errno)));
  return read_all(file.get());
}

}  // namespace

Expected<std::string> read_content(const std::string& path) {
  auto content = or_out_of_memory([&] { return read_path(path); }, too_large_file);
  if (content && content->empty()) return unexpected(failure(ErrorCode::invalid_argument, "is empty"));
  return content;
}

std::string name_of_file(const std::string& path) {
  return path == "-" ? "stdin" : std::filesystem::path(path).stem().string();
}

Error too_large_file() {
  return failure(ErrorCode::resource_exhausted, "is too large for the memory there is");
}

Expected<ProblemFile> parse_json_file(std::string_view content, const std::string& name) {
  MARBLE_ASSIGN_OR_RETURN(auto read, parse_json(content, name));
  return ProblemFile{std::move(read.problem), read.best_known_objective, false};
}

}  // namespace marble::client

namespace marble {

Expected<ProblemFile> read_json_problem(const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(const auto content, client::read_content(path));
  const std::string name = client::name_of_file(path);
  return or_out_of_memory([&] { return client::parse_json_file(content, name); }, client::too_large_file);
}

}  // namespace marble
