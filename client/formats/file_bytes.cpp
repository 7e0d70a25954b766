#include "file_bytes.h"

#include <fstream>
#include <sstream>

namespace marble::formats {

Expected<std::string> read_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  if (file.peek() != std::ifstream::traits_type::eof()) content << file.rdbuf();
  if (!file.is_open() || file.bad() || content.fail())
    return unexpected(failure(ErrorCode::not_found, "cannot be read"));
  return std::move(content).str();
}

}  // namespace marble::formats
