// Tar archives (POSIX.1-1988, ustar) compressed by zstd: regular files, one after the other.
#pragma once

#include <zstd.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "marble/error.h"

namespace marble {

class TarZstWriter {
 public:
  using Sink = std::function<Expected<void>(std::string_view)>;
  explicit TarZstWriter(Sink sink);

  /// Reported pieces of a file's content.
  using Report = std::function<Expected<void>(std::string_view)>;
  /// A name of less than 100 bytes; `content` writes exactly `size` bytes.
  [[nodiscard]] Expected<void> add(const std::string& name, std::uint64_t size, std::int64_t unix_s,
                                   const std::function<Expected<void>(const Report&)>& content);
  /// The end of the archive.
  [[nodiscard]] Expected<void> finish();

 private:
  [[nodiscard]] Expected<void> put(std::string_view bytes, ZSTD_EndDirective end = ZSTD_e_continue);

  struct Free {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  };
  const Sink sink_;
  const std::unique_ptr<ZSTD_CCtx, Free> context_;
  std::vector<char> packed_;
};

/// What to do with a file of an archive.
enum class TarTake { skip, keep };

/// Asks about each regular file, and gives the content of those to keep. It may unpack to `most_bytes` in
/// all. Errors: invalid_argument, with what is wrong; what `ask` returns.
[[nodiscard]] Expected<void> read_tar_zst(
    std::string_view file, std::uint64_t most_bytes,
    const std::function<Expected<TarTake>(std::string_view name, std::uint64_t size)>& ask,
    const std::function<void(std::string_view name, std::string content)>& take);

}  // namespace marble
