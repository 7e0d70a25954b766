#include "marble/problem_file.h"

#include <filesystem>

#include "file/binary_problem.h"
#include "file/content.h"
#include "file/json_file.h"
#include "marble/json_problem.h"

namespace marble {
Expected<FileFormat> format_of_path(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".json") return FileFormat::json;
  if (extension == ".pb" || extension == ".bin") return FileFormat::binary;
  return unexpected(
      failure(ErrorCode::invalid_argument, "must end in .json, .pb or .bin: the extension names the format"));
}

FileFormat format_of_content(std::string_view content) {
  const std::size_t first = content.find_first_not_of(" \t\r\n");
  const bool json = first != std::string_view::npos && (content[first] == '{' || content[first] == '[');
  return json ? FileFormat::json : FileFormat::binary;
}

Expected<ProblemFile> parse_problem(std::string_view content, FileFormat format, const std::string& name) {
  const auto parse = format == FileFormat::json ? client::parse_json_file : client::parse_binary;
  return or_out_of_memory([&] { return parse(content, name); }, client::too_large_file);
}

Expected<ProblemFile> read_problem(const std::string& path) {
  const auto content = client::read_content(path);
  if (!content) return unexpected(content.error());
  const std::string name = client::name_of_file(path);
  if (const auto format = format_of_path(path)) return parse_problem(*content, *format, name);
  const FileFormat format = format_of_content(*content);
  auto file = parse_problem(*content, format, name);
  const bool parsed = file || !file.error().field.empty();
  if (!parsed && format == FileFormat::binary) {
    return unexpected(
        failure(ErrorCode::invalid_argument, "is neither JSON nor a marble.v1.Problem message"));
  }
  return file;
}

std::string write_problem(const ProblemFile& file, FileFormat format) {
  return format == FileFormat::json ? write_json(file.problem, file.best_known_objective)
                                    : client::write_binary(file);
}

}  // namespace marble
