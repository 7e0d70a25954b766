// Provides a file that is written completely or not at all.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "marble/error.h"

namespace marble::cli {

/// Writes beside the file and renames at the end. Anything but a regular file (a pipe, a terminal) is written
/// directly. Without commit() nothing is left, and an older file stays unchanged.
class AtomicFile {
 public:
  /// Fails at once if the file cannot be written. The error's field is the path.
  [[nodiscard]] static Expected<AtomicFile> open(const std::string& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  /// commit() reports errors.
  void write(std::string_view bytes);
  [[nodiscard]] Expected<void> commit();

 private:
  AtomicFile(std::string path, std::string beside, std::FILE* file)
      : path_(std::move(path)), beside_(std::move(beside)), file_(file) {}

  std::string path_;
  std::string beside_;  // empty: written directly
  std::FILE* file_;     // null: done
  bool failed_ = false;
};

}  // namespace marble::cli
