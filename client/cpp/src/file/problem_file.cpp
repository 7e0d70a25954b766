#include "marble/problem_file.h"

#include <filesystem>
#include <limits>

#include "file/content.h"
#include "marble/convert.h"
#include "marble/json_problem.h"
#include "marble/owned.h"
#include "message_text.h"

namespace marble::client {
namespace {

// The binary form is the message marble.v1.Problem.
Expected<ProblemFile> parse_binary(std::string_view content, const std::string& name) {
  v1::Problem message;
  if (content.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()) ||
      !message.ParseFromArray(content.data(), static_cast<int>(content.size()))) {
    return unexpected(failure(ErrorCode::invalid_argument,
                              "is not a marble.v1.Problem message (truncated, or of another format)"));
  }
  const ProblemView view = view_of(message);
  if (const auto valid = Problem::create(view); !valid)
    return unexpected(of_field(message_field(valid.error().field), valid.error()));
  ProblemFile file;
  file.problem = owned(view);
  file.problem.name = message.name().empty() ? name : message.name();
  return file;
}

std::string write_binary(const ProblemFile& file) {
  v1::Problem message;
  to_message(file.problem.view(), &message);
  message.set_name(message_text(file.problem.name, contract::longest_problem_name));
  return message.SerializeAsString();
}

}  // namespace
}  // namespace marble::client

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
  MARBLE_ASSIGN_OR_RETURN(const auto content, client::read_content(path));
  const std::string name = client::name_of_file(path);
  if (const auto format = format_of_path(path)) return parse_problem(content, *format, name);
  const FileFormat format = format_of_content(content);
  auto file = parse_problem(content, format, name);
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
