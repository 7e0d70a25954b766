#include "base/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

namespace marble::cli {
namespace {

constexpr int kReadableByAll = 0666;  // minus the umask

Error cannot_write(const std::string& path) {
  return failure(ErrorCode::not_found, path, std::string("cannot be written: ") + std::strerror(errno));
}

// A link stays a link: its target is replaced.
std::filesystem::path target_of(const std::string& path) {
  std::error_code fault;
  const auto target = std::filesystem::weakly_canonical(path, fault);
  return fault ? std::filesystem::path(path) : target;
}

bool is_special(const std::filesystem::path& path) {
  std::error_code fault;
  const auto status = std::filesystem::status(path, fault);
  return std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
}

}  // namespace

Expected<AtomicFile> AtomicFile::open(const std::string& path) {
  const std::filesystem::path target = target_of(path);
  const bool direct = is_special(path);
  if (!direct && access(target.c_str(), F_OK) == 0 && access(target.c_str(), W_OK) != 0)
    return unexpected(cannot_write(path));
  const std::string beside = direct ? "" : target.string() + "." + std::to_string(getpid()) + ".part";
  const int flags = O_WRONLY | O_CLOEXEC | (direct ? 0 : O_CREAT | O_TRUNC | O_NOFOLLOW);
  const int descriptor = ::open((direct ? path : beside).c_str(), flags, kReadableByAll);
  if (descriptor < 0) return unexpected(cannot_write(path));
  std::FILE* const file = fdopen(descriptor, "w");
  if (file == nullptr) {
    close(descriptor);
    return unexpected(cannot_write(path));
  }
  return AtomicFile(direct ? path : target.string(), beside, file);
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      beside_(std::move(other.beside_)),
      file_(std::exchange(other.file_, nullptr)),
      failed_(other.failed_) {}

AtomicFile::~AtomicFile() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  if (!beside_.empty()) unlink(beside_.c_str());
}

void AtomicFile::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) failed_ = true;
}

Expected<void> AtomicFile::commit() {
  const bool written = std::fclose(std::exchange(file_, nullptr)) == 0 && !failed_;
  if (written && (beside_.empty() || std::rename(beside_.c_str(), path_.c_str()) == 0)) return {};
  const Error error = cannot_write(path_);
  if (!beside_.empty()) unlink(beside_.c_str());
  return unexpected(error);
}

}  // namespace marble::cli
