#include "formats.h"

#include <filesystem>
#include <fstream>

#include "file_bytes.h"
#include "matrix_market.h"
#include "nl/nl_problem.h"
#include "npz_problem.h"

namespace marble::formats {
namespace {

std::string extension_of(const std::string& path) { return std::filesystem::path(path).extension().string(); }

bool is_folder(const std::string& path) {
  std::error_code failed;
  return path.ends_with('/') || std::filesystem::is_directory(path, failed);
}

std::string name_of(std::string path) {
  while (path.size() > 1 && path.ends_with('/')) path.pop_back();
  return std::filesystem::path(path).stem().string();
}

// Describes the known extensions, for a file with an unknown one.
std::string known_endings(const std::string& extension) {
  std::string text =
      "what is read ends in .json, .pb, .bin, .npz or .nl, or is a folder of Matrix Market files";
  for (const char* other : {".mps", ".qps", ".lp"}) {
    if (extension == other)
      text += "; MPS, QPS and LP files are solved by: python3 -m marble solve FILE (with highspy installed)";
  }
  return text;
}

// MATLAB's files are read by the Python package alone.
Expected<ProblemFile> refuse_mat(const std::string& path) {
  const std::string json = std::filesystem::path(path).replace_extension(".json").string();
  return unexpected(
      invalid("", ".mat", "must be converted first: python3 -m marble convert " + path + " " + json));
}

Expected<ProblemFile> read_nl(const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(const auto content, read_bytes(path));
  return parse_nl(content, name_of(path), NlNames::beside(path.substr(0, path.size() - 3)));
}

}  // namespace

Expected<ProblemFile> read_any_problem(const std::string& path) {
  const auto read = [&] {
    if (path != "-" && is_folder(path)) return read_matrix_market(path, name_of(path));
    const std::string extension = extension_of(path);
    if (extension == ".npz") return read_npz(path, name_of(path));
    if (extension == ".mat") return refuse_mat(path);
    if (extension == ".nl") return read_nl(path);
    auto file = read_problem(path);
    if (!file && file.error().field.empty() && path != "-" && !format_of_path(path) &&
        file.error().code == ErrorCode::invalid_argument)
      file.error().bound += "; " + known_endings(extension);
    return file;
  };
  return or_out_of_memory(
      read, [] { return failure(ErrorCode::resource_exhausted, "is too large for the memory there is"); });
}

Expected<void> check_writable_format(const std::string& path) {
  if (is_folder(path) || extension_of(path) == ".npz" || format_of_path(path)) return {};
  return unexpected(
      failure(ErrorCode::invalid_argument,
              "must end in .json, .pb, .bin, .npz or /: the extension names the format, / a folder of "
              "Matrix Market files"));
}

bool keeps_initial_point(const std::string& path) {
  const auto format = format_of_path(path);
  return !format || *format == FileFormat::json;
}

Expected<void> write_any_problem(const ProblemFile& file, const std::string& path) {
  if (is_folder(path)) return write_matrix_market(file, path);
  if (extension_of(path) == ".npz") return write_npz(file, path);
  const auto format = format_of_path(path);
  if (!format) return check_writable_format(path);
  std::ofstream stream(path, std::ios::binary);
  stream << write_problem(file, *format);
  stream.close();
  if (stream) return {};
  return unexpected(failure(ErrorCode::unavailable, "cannot be written"));
}

}  // namespace marble::formats
