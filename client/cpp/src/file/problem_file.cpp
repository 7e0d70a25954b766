#include "marble/problem_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "file/binary_problem.h"
#include "file/json_problem.h"

namespace marble {
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

Error not_a_problem(const char* why) { return failure(ErrorCode::invalid_argument, why); }

Error too_large() { return failure(ErrorCode::resource_exhausted, "is too large for the memory there is"); }

}  // namespace

Expected<FileFormat> format_of_path(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".json") return FileFormat::json;
  if (extension == ".pb" || extension == ".bin") return FileFormat::binary;
  return unexpected(
      failure(ErrorCode::invalid_argument, "must end in .json, .pb or .bin: the extension tells the format"));
}

FileFormat format_of_content(std::string_view content) {
  const std::size_t first = content.find_first_not_of(" \t\r\n");
  const bool json = first != std::string_view::npos && (content[first] == '{' || content[first] == '[');
  return json ? FileFormat::json : FileFormat::binary;
}

Expected<ProblemFile> parse_problem(std::string_view content, FileFormat format, const std::string& name) {
  const auto parse = format == FileFormat::json ? client::parse_json : client::parse_binary;
  return or_out_of_memory([&] { return parse(content, name); }, too_large);
}

Expected<ProblemFile> read_problem(const std::string& path) {
  const auto content = or_out_of_memory([&] { return read_path(path); }, too_large);
  if (!content) return unexpected(content.error());
  if (content->empty()) return unexpected(not_a_problem("is empty"));
  const std::string name = path == "-" ? "stdin" : std::filesystem::path(path).stem().string();
  if (const auto format = format_of_path(path)) return parse_problem(*content, *format, name);
  const FileFormat format = format_of_content(*content);
  auto file = parse_problem(*content, format, name);
  const bool parsed = file || !file.error().field.empty();
  if (!parsed && format == FileFormat::binary) {
    return unexpected(not_a_problem("is neither JSON nor a marble.v1.Problem message"));
  }
  return file;
}

std::string write_problem(const ProblemFile& file, FileFormat format) {
  return format == FileFormat::json ? client::write_json(file) : client::write_binary(file);
}

}  // namespace marble
