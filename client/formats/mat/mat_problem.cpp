#include "mat/mat_problem.h"

#include "mat/mat73_problem.h"
#include "mat/mat_file.h"
#include "parts/file_bytes.h"

namespace marble::formats {

Expected<ProblemFile> parse_mat(std::string_view bytes, const std::string& name) {
  const auto file = MatFile::open(bytes);
  if (!file) return unexpected(file.error());
  return assemble_lcqpow([&](const char* variable) { return file->read(variable); }, name);
}

Expected<ProblemFile> read_mat(const std::string& path, const std::string& name) {
  const auto bytes = read_bytes(path);
  if (!bytes) return unexpected(bytes.error());
  return is_mat73(*bytes) ? read_mat73(path, name, bytes->size()) : parse_mat(*bytes, name);
}

}  // namespace marble::formats
