#include "base/text_file.h"

#include <cerrno>
#include <cstdio>
#include <memory>
#include <system_error>

namespace marble::server {

Expected<std::string> read_text_file(const std::string& path) {
  const auto failed = [&] {
    return unexpected(
        failure(ErrorCode::not_found, "", path, "cannot be read: " + std::generic_category().message(errno)));
  };
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"), std::fclose);
  if (file == nullptr) return failed();
  std::string content;
  char buffer[4096];
  while (const std::size_t count = std::fread(buffer, 1, sizeof buffer, file.get()))
    content.append(buffer, count);
  if (std::ferror(file.get()) != 0) return failed();  // for example a directory
  return content;
}

}  // namespace marble::server
